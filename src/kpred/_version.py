"""The version of the package; a file of its own, so that lower floors need not import the package."""

__version__ = "0.1.0"
