"""Functions of records and measurements to tables for a terminal and for Markdown."""
