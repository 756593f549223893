"""What every command runs on: processes, signals, outputs, errors in words."""
