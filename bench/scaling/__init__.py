"""Time and memory against vertices, feature width, layers, rank and characters."""
