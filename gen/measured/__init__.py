"""Measured surfaces: reading instruments' files, preparing heights, contacts of one surface."""
