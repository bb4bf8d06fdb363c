"""Furniture libraries of Sweet Home 3D (`.sh3f`), as a catalogue folder of meshes with their licences."""
