"""The version of Asperity: the one place that states it."""

VERSION = "1.0.0rc1"
"""Version as PEP 440 writes it; pyproject.toml and `asperity.__version__` take it from here."""
