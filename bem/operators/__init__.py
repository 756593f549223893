"""The influence matrix of a patch, free or without edges: coefficients, filters, approximate
inverse.
"""
