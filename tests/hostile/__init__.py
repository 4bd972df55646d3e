"""Hostile files: how they are made, which loaders meet them, and what is judged."""
