"""Exports: fitted furniture as files of other tools; one format a file, `format_table` lists them."""
