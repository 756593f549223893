"""Asperity: contact of rough surfaces, databases of it, surrogates and benchmarks.

The work is done by four packages beside this one: `bem`, `gen`, `learn` and `bench`. This one has
the version and the command `asperity`, which runs the other packages' programs.
"""

from gen.runtime import VERSION

__version__: str = VERSION
"""Version of the installed distribution."""
