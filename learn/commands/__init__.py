"""The commands of `python -m learn`. Each module imports only what its commands need."""
