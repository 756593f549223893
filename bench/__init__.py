"""Asperity's measurements of itself: benchmarks that assert their answers."""

from contextlib import suppress

with suppress(ModuleNotFoundError):  # in an editable install that is older than this package
    from asperity.neighbours import require

    require("bench", "bem", "gen", "learn")
