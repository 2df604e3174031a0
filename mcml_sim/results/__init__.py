"""Results of runs with errors, and the files that hold them."""
