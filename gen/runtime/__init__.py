"""The ground of every command: processes, signals, outputs, errors in words."""
