"""Other published methods, for the same tables."""
