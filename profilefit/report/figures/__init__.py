"""Functions of records and measurements to figures."""
