"""Data and a law become constants with errors."""
