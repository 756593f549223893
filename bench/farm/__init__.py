"""The farm on this machine: speed-up on more processes, and how fast rows are written."""
