"""Phase functions fitted to measured or computed ones: tables, fits with errors, records."""
