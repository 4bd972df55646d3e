"""Hostile files: how they are made, which loaders meet them, and who counts what happens."""
