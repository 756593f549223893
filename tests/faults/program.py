"""`python -m tests.faults.program AILMENTS ...`: `python -m gen ...` in which some samples ail.

AILMENTS is a JSON file of far-field displacements, by which a sample is known, and what it suffers
from. All else is the program as it is: the seam is `bem.solve`.
"""

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NoReturn
from unittest import mock

import bem
import gen.__main__
from gen.arrays import Heights

Solve = Callable[[], bem.Contact]

_healthy = bem.solve


def raises(solve: Solve) -> NoReturn:
    """Stumble over the numbers."""
    raise FloatingPointError("injected")


def returns_nan(solve: Solve) -> bem.Contact:
    """Solve, and lose the result on the way."""
    return replace(solve(), force=float("nan"))


def does_not_converge(solve: Solve) -> NoReturn:
    """Give up a contact."""
    raise bem.NotConverged(solve())


AILMENTS: dict[str, Callable[[Solve], bem.Contact]] = {
    ailment.__name__: ailment for ailment in (raises, returns_nan, does_not_converge)
}


def ailing(ailments: Mapping[float, str]) -> Callable[..., bem.Contact]:
    """The solver of a program in which the samples with these displacements ail."""

    def solves(heights: Heights, side: Any, delta: float, **more: Any) -> bem.Contact:
        solve = partial(_healthy, heights, side, delta, **more)
        return AILMENTS[ailments[delta]](solve) if delta in ailments else solve()

    return solves


def main() -> int:
    """Run `python -m gen` with the ailments."""
    path = Path(sys.argv.pop(1))
    ailments = {float(delta): name for delta, name in json.loads(path.read_text()).items()}
    with mock.patch.object(bem, "solve", ailing(ailments)):
        return gen.__main__.main()


if __name__ == "__main__":
    sys.exit(main())
