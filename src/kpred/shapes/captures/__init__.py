"""Folders of depth pictures with their cameras, as phones, depth cameras and data sets record them."""
