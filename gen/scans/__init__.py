"""Windows of measured maps as surfaces: maps that are prepared once, their tiles, and the draw."""
