"""instrument/sources."""
