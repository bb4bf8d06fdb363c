"""Methods: whatever retrieves database shapes for a target and deforms them is measured alike."""
