"""The reading of what the paper leaves open that gives numbers nearest to its tables."""
