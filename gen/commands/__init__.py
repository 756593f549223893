"""The commands of `asperity gen`. Each module imports only what its commands need."""
