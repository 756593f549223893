"""Surfaces that were measured: instruments' files, their preparation, contacts of one surface."""
