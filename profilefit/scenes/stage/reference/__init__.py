"""References of pictures: exact light over a surface, and at a step edge."""
