"""The one error that means: the user gave something that cannot be used."""


class InputError(ValueError):
    """What was given, what is allowed and where, in one line; the command line exits with 2."""
