"""Pictures of fits and scenes."""
