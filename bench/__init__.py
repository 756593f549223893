"""Measure solver, statistics and database: benchmarks that assert their answers."""
