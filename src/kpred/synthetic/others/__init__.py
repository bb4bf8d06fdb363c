"""Shapes that are no furniture: negatives for the recognizer."""
