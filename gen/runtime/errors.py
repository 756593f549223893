"""The error for input that cannot be used."""


class InputError(ValueError):
    """Unusable input: one line with the given and the allowed value; commands then exit with 2."""


class SourceError(InputError):
    """A map or function that a scene names is missing, has changed or fails: the run ends."""
