"""Furnished rooms and their scans, as training data: layout, scanners, fusion, packs."""
