"""Measures of whole rooms: objects found in a raw scan, and their CAD models together."""
