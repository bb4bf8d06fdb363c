"""Figures: occlusion curves, maps of retrieval tokens, keypoints, influence, and grids of results."""
