"""Studio: look at a fit in the browser and correct it by hand; every gesture can be undone and replayed."""
