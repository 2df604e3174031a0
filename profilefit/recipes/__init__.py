"""One command, one record: what to fit to what, and the folder of what was fitted."""
