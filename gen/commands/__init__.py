"""The commands of `python -m gen`. Each module imports only what its commands need."""
