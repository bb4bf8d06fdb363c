"""Chair families."""
