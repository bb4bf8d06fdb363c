"""Cabinet families."""
