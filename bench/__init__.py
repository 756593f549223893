"""Asperity's measurements of itself: benchmarks that assert their answers."""
