"""Calls of the console made up by the thousand: as its description allows, as it forbids, and as nobody would write."""
