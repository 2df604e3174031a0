"""Liang et al.'s head."""
