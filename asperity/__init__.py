"""Asperity: contact of rough surfaces, databases of it, surrogates and benchmarks.

Four packages beside this one do the work: `bem`, `gen`, `learn` and `bench`. This package has the
version, the command `asperity`, which runs the programs of the other packages, and functions of a
scene's numbers for codes that ask many questions.
"""

from gen.runtime import VERSION

# Type checkers take this name for true, as that of `typing`, whose import would delay the command.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from asperity.functions import OutsideTraining, SceneFunction, SurrogateFunction

__all__ = ["OutsideTraining", "SceneFunction", "SurrogateFunction", "__version__"]

__version__: str = VERSION
"""Version of the installed distribution, as "1.1.0"."""


def __getattr__(name: str) -> object:
    """Import a function class when it is first used, because the command does not need it."""
    if name in {*__all__} - {"__version__"}:
        from asperity import functions

        return getattr(functions, name)
    raise AttributeError(f"module 'asperity' has no attribute {name!r}")
