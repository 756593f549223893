"""Databases, contacts and surfaces printed as tables for people."""
