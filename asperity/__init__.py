"""Asperity: contact of rough surfaces, databases of it, surrogates and benchmarks.

The work is done by four packages beside this one: `bem`, `gen`, `learn` and `bench`. This one has
the version, the command `asperity`, which runs the other packages' programs, and functions of a
scene's numbers for codes that ask many questions.
"""

from gen.runtime import VERSION

TYPE_CHECKING = (
    False  # true for mypy, as that of typing, whose import would delay the command
)
if TYPE_CHECKING:
    from asperity.functions import OutsideTraining, SceneFunction, SurrogateFunction

__all__ = ["OutsideTraining", "SceneFunction", "SurrogateFunction", "__version__"]

__version__: str = VERSION
"""Version of the installed distribution."""


def __getattr__(name: str) -> object:
    """Import the functions when they are asked for, as the command does not need them."""
    if name in {*__all__} - {"__version__"}:
        from asperity import functions

        return getattr(functions, name)
    raise AttributeError(f"module 'asperity' has no attribute {name!r}")
