"""What the paper does not say, varied one choice at a time, and what that does to its numbers."""
