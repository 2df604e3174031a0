"""One's own data: a measured or simulated profile, the medium it tells of, and how far it tells it."""
