"""Table families."""
