"""The programs of the packages, of which `asperity` imports the one that is asked for."""

from typing import NamedTuple


class Program(NamedTuple):
    """A program of one of the packages.

    Attributes
    ----------
    module : str
        Module with the program's `app` and `main`.
    packages : tuple of str
        Packages of Asperity that it imports.
    default_sigint : bool
        Whether Ctrl-C ends it at once until a run listens to signals, see `command_line.start`.
    summary : str
        Line for the help.
    """

    module: str
    packages: tuple[str, ...]
    default_sigint: bool
    summary: str


PROGRAMS = {
    "gen": Program(
        "gen.cli",
        ("bem", "gen"),
        True,
        "Surfaces, contacts, laws of interfaces, and databases of contact problems.",
    ),
    "learn": Program(
        "learn.cli",
        ("bem", "gen", "learn"),
        True,
        "Surrogates of databases: fit, predict, laws, nine models compared.",
    ),
    "bench": Program(
        "bench.__main__",
        ("bem", "gen", "learn", "bench"),
        False,
        "Reports on exactness and speed (needs the extra 'bench').",
    ),
    "serve": Program(
        "asperity.serving.cli",
        ("bem", "gen", "learn"),
        False,
        "A server of solver and surrogates for UM-Bridge's clients (needs the extra 'serve').",
    ),
}
"""The programs by their names, in the order of the help."""
