"""Measure `bem.solve_within`: its errors beside those asked for, and its time to an area."""
