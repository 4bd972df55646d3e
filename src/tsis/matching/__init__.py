"""Non-rigid matching of points: which point of one set belongs to which of another, and the map between them."""
