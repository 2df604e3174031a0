"""Subjects that scenes draw: a head of solids of formulas and eyes, or a mesh of a file."""
