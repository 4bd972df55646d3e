"""Scans that judge the map: solved in three dimensions, never by the map's kernel."""
