"""The shader source of a law, run on a GPU and judged: by float64, by the exact half space, by its record."""
