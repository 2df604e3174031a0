"""The mcml-sim command, and what both commands have in common."""
