"""The fault campaign: runs are disturbed in every way that a machine knows, and nothing is lost."""
