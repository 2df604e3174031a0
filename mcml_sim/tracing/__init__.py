"""Photons: random numbers, pools of lanes, one event, one batch, and what it counts."""
