"""Generate databases: plan their rows, compute them on all processes, and check the files."""
