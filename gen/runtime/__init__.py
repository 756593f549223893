"""Services that all commands use: processes, signals, files, printing, messages for errors."""

VERSION = "1.1.0"
"""Version of all packages of this repository, as PEP 440 writes it; no other file states it."""
