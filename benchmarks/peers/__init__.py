"""Other programs at the same task, each in a file of its own; what is not installed is left out by name."""
