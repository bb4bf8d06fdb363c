"""Cleaning of scans: outliers, planes, floor and walls, downsampling."""
