"""Questions asked of every law and scene: which to choose, where each fails, what each costs."""
