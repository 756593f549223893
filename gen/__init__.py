"""Asperity's databases of rough-surface contact: scenes, surfaces, statistics, and their runs.

`generation` plans, computes and checks rows, `database` keeps them, `measured` reads surfaces of
instruments and presses them one by one, `runtime` is what every command of the project runs on.
"""

from contextlib import suppress

with suppress(ModuleNotFoundError):  # in an editable install that is older than this package
    from asperity.neighbours import require

    require("gen", "bem")
