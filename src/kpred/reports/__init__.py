"""Reports: one HTML file that needs nothing else, of a fit, a batch or a room."""
