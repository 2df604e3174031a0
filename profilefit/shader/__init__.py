"""The fitted closed forms as shader text, run on a GPU and judged there."""
