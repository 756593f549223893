"""The commands of `asperity learn`. Each module imports only what its commands need."""
