"""Readers and writers of single file formats."""
