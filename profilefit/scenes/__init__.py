"""Calibrated closed forms on a stage, each beside its truth."""
