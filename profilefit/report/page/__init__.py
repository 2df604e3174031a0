"""The report as one HTML file that needs nothing beside it: tables, figures, the explorer, and where all comes from."""
