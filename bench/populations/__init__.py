"""Populations of surfaces: made maps that stand for measured ones, and studies on them."""
