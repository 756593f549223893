"""Asperity: contact of rough surfaces, databases of it, surrogates and benchmarks.

The work is done by four packages beside this one: `bem`, `gen`, `learn` and `bench`. This one has
the version and the command `asperity`, which runs the other packages' programs.
"""

from typing import Any

__version__: str
"""Version of the installed distribution."""


def __getattr__(name: str) -> Any:
    """Look the version up when it is asked for; the command looks for a foreign `gen` before."""
    if name == "__version__":
        from gen.runtime.installation import VERSION

        return VERSION
    raise AttributeError(f"module 'asperity' has no attribute {name!r}")
