"""Head that scenes draw where a file names no mesh: solids of formulas, and eyes."""
