"""Random contacts whose pressure is bounded by a hardness, beside bounded least squares."""
