"""A contact law as JSON: the tables with their units, and how they were made."""

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gen.arrays import Values
from gen.law.contact_law import Law
from gen.law.curves import Curves
from gen.runtime import documents, files
from gen.runtime.installation import git_commit, versions

FORMAT = "asperity contact law"
VERSION = 1
"""Raised whenever a reader of the last version would misread a file."""


def write(path: Path, law: Law) -> None:
    """Write a law as JSON, whole or not at all.

    Numbers that are not finite are null. Units stand in the names of the quantities.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    content = {
        "format": FORMAT,
        "version": VERSION,
        "e_star_MPa": law.bodies.e_star,
        "hardness_MPa": law.bodies.hardness,
        "conductivities_W_per_m_K": law.order.conductivities,
        "boundary": law.boundary,
        "surfaces": list(law.origins),
        "band": law.band,
        "notes": list(law.notes),
        "command": law.order.command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "asperity": versions(["asperity"]).get("asperity", ""),
        "commit": git_commit(),
        "tables": [_table(law.over_delta), _table(law.over_pressure)],
    }
    files.write(path, documents.text_of(content))


def _table(curves: Curves) -> dict[str, Any]:
    """Return one table."""
    return {
        "against": curves.against,
        "at": _numbers(curves.at),
        "gap_at_rest_um": curves.gap_at_rest,
        "share_of_surfaces_outside_the_training": _numbers(curves.outside),
        "reasons": list(curves.reasons),
        "curves": {
            name: {
                part: _numbers(getattr(curves.curves[name], part))
                for part in ("value", "low", "high", "slope")
            }
            for name in curves.names
        },
    }


def _numbers(values: Values) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]
