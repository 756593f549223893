"""The tests, and two programs beside them: `python -m tests.faults`, `python -m tests.fuzz`."""
