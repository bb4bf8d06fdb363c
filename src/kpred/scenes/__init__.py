"""Room scans, and the objects labelled in them."""
