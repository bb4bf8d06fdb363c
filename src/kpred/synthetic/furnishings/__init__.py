"""Furnishings beside chairs, tables and cabinets: beds, sofas, lamps, appliances, fixtures."""
