"""What a run found, with errors, and the files that hold it."""
