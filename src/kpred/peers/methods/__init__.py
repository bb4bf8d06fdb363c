"""Peers as methods of the evaluation."""
