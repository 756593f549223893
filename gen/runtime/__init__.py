"""The ground of every command: processes, signals, files, printing, errors in words."""

VERSION = "1.0.0"
"""Version as PEP 440 writes it, stated here alone."""
