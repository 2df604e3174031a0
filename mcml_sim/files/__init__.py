"""Files as a whole: one writer, bounded readers of text, JSON, TOML and .npz."""
