"""Training of peers, in the package's own loop and on its own data."""
