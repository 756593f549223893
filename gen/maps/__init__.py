"""Measured maps: read, prepared, described, pressed, and cut into windows for scenes."""
