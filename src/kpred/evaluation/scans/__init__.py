"""Measurements of whole fits, from scans of virtual and real objects."""
