"""Tables of errors of methods in a known frame."""
