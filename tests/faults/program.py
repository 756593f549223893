"""`python -m tests.faults.program AILMENTS ...`: `python -m gen ...` in which some samples ail.

AILMENTS is a JSON file of far-field displacements, by which a sample is known, and what it suffers
from. A run of seconds is to be disturbed in its midst, so it syncs its rows more often. All else is
the program as it is: the seams are `bem.solve` and `SYNC_SECONDS`.
"""

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import bem
import gen.__main__
from gen.arrays import Heights
from gen.database import writer

SYNC_SECONDS = 0.1  # least time between two syncs [s]

_healthy = bem.solve


def ailing(ailments: Mapping[float, str]) -> Callable[..., bem.Contact]:
    """The solver of a program in which the samples with these displacements ail."""

    def solve(heights: Heights, side: Any, delta: float, **more: Any) -> bem.Contact:
        ailment = ailments.get(delta)
        if ailment == "raises":
            raise FloatingPointError("injected")
        contact = _healthy(heights, side, delta, **more)
        if ailment == "does_not_converge":
            raise bem.NotConverged(contact)
        return (
            replace(contact, force=float("nan")) if ailment == "returns_nan" else contact
        )

    return solve


def main() -> int:
    """Run `python -m gen` with the ailments."""
    path = Path(sys.argv.pop(1))
    ailments = {
        float(delta): name for delta, name in json.loads(path.read_text()).items()
    }
    often = mock.patch.object(writer, "SYNC_SECONDS", SYNC_SECONDS)
    with often, mock.patch.object(bem, "solve", ailing(ailments)):
        return gen.__main__.main()


if __name__ == "__main__":
    sys.exit(main())
