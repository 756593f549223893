"""The influence matrix of a patch, free or without edges, and its approximate inverse."""
