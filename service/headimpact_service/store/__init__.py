"""Storage: SQL lives here and nowhere else, as plain functions that take a connection."""
