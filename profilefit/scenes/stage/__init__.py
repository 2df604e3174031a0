"""Machinery of every scene: passes, renderer, judge, G-buffer, gather, exact edges and integrals, a head."""
