"""The commands of `python -m bench`; each imports what it needs when it is called."""
