"""Liang et al.'s own fit, step by step: protocol, readings of it, Table 1."""
