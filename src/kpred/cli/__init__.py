"""The command line: one file a command; each parses its options, calls the library and prints the result."""
