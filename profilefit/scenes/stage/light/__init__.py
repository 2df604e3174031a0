"""Light that falls on a scene: lamps, the sky, and what hides it."""
