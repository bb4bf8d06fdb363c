"""The error of a command line that makes no sense."""


class UsageError(Exception):
    """The options make no sense together; one sentence that ends the program with exit code 2."""
