"""Coarse furniture of cuboids, as in part data sets."""
