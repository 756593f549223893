"""What surrogates of the paper preset are tested on: more of the same, and what they never saw."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.databases import OTHER_SEED, generated
from bench.surrogates.fitting import Parts, read, request_for
from gen.database import Reader
from gen.scene import Piece, load
from learn.arrays import Indices
from learn.dataset import Dataset

HURST_BORDER = 0.7
"""Surfaces below it train, surfaces above it test."""

MENDING_SHARE = 1 / 3
"""Of the rows of a test database: what is tried as a cure. The others judge."""

HOME = "same distribution"
"""The case that all others are compared with."""

HURST = "unseen Hurst"
FINE = "fine grid (257)"


@dataclass(frozen=True)
class Case:
    """A database to test on.

    Attributes
    ----------
    name : in tables
    file : name of database and scene
    scene : what differs from the paper preset, but for samples and seed (TOML)
    """

    name: str
    file: str
    scene: str


@dataclass(frozen=True, eq=False)
class Trial:
    """Rows of a case with one feature set.

    Attributes
    ----------
    name : of the case
    parts : what the surrogate on trial is trained on
    judged : (n) rows that judge it
    mending : rows of the same kind that it is mended with, None where there is nothing to mend
    resampled : rows that judge it, with the features of every second node; None for other grids
    coarse_areas : (resampled rows,) areas solved at every second node [%]; None for other grids
    """

    name: str
    parts: Parts
    judged: Dataset
    mending: Dataset | None
    resampled: Dataset | None = None
    coarse_areas: NDArray[np.float64] | None = None


def scan_length(side: float, heights: float) -> str:
    """Scene of another scan length [um], heights and displacements times a factor."""
    preset = load("paper")
    low, high = preset.surface.sigma0
    pieces = ", ".join(_piece(piece, heights) for piece in preset.delta.pieces)
    return (
        f"[surface]\nside = {side!r}\nsigma0 = [{low * heights!r}, {high * heights!r}]\n"
        f"[delta]\npieces = [{pieces}]\n"
    )


def _piece(piece: Piece, heights: float) -> str:
    low, high = piece.range
    return f"{{ share = {piece.share!r}, range = [{low * heights!r}, {high * heights!r}] }}"


CASES = (
    Case(FINE, "fine", "[surface]\nnodes = 257\n"),
    Case("midpoint generator", "midpoint", '[surface]\ngenerator = "midpoint"\n'),
    Case("L = 300 um, scaled", "side300-scaled", scan_length(300.0, 0.3)),
    Case("L = 300 um, same heights", "side300", scan_length(300.0, 1.0)),
    Case("L = 0.3 um, scaled", "side0.3-scaled", scan_length(0.3, 0.0003)),
    Case("L = 0.3 um, same heights", "side0.3", scan_length(0.3, 1.0)),
)

RESAMPLED = Case("every second node", "every-second-node", "")
"""The surfaces of the fine grid at its coarse nodes: surfaces of one seed are nested."""


def databases(folder: Path, rows: int, remark: Callable[[str], None]) -> dict[str, Path]:
    """Generate the databases to test on, by the name of their case.

    Parameters
    ----------
    folder : where to
    rows : of each
    remark : told about each
    """
    head = f"samples = {rows}\nseed = {OTHER_SEED}\n"
    return {
        case.name: generated(folder, case.file, head + case.scene) for case in (*CASES, RESAMPLED)
    }


def trials(
    parts: Parts, tested: dict[str, Path], model: str, features: str, area_max: float
) -> Iterator[Trial]:
    """Yield every case with one feature set; the one at home first.

    Parameters
    ----------
    parts : the paper preset's rows
    tested : databases by the name of their case
    model, features : what is tested
    area_max : largest area that counts [%]
    """

    def rows_of(name: str, area_max: float) -> Dataset:
        return read(request_for(tested[name], model, features, area_max))

    def coarser(case: Case, judged: Dataset) -> tuple[Any, ...]:
        return resampled(judged, rows_of(RESAMPLED.name, 100.0)) if case.name == FINE else ()

    yield Trial(HOME, parts, parts.test, None)
    yield unseen_hurst(parts)
    for case in CASES:
        rows = rows_of(case.name, area_max)
        order = np.random.default_rng(0).permutation(rows.size)
        cut = int(MENDING_SHARE * rows.size)
        judged = rows.at(np.sort(order[cut:]))
        yield Trial(case.name, parts, judged, rows.at(order[:cut]), *coarser(case, judged))


def resampled(fine: Dataset, coarse: Dataset) -> tuple[Dataset, NDArray[np.float64]]:
    """Rows of the fine grid with the features of the coarse one, and the areas solved there."""
    _, here, there = np.intersect1d(fine.rows, coarse.rows, return_indices=True)
    return replace(fine.at(here), inputs=coarse.inputs[there]), coarse.target[there]


def unseen_hurst(parts: Parts) -> Trial:
    """Train on the lower Hurst exponents only, test on the test rows of the upper ones."""
    with Reader(Path(parts.train.source["database"])) as reader:
        hurst = reader.column("hurst")

    def split(rows: Dataset) -> tuple[Indices, Indices]:
        low = hurst[rows.rows] <= HURST_BORDER
        return np.flatnonzero(low), np.flatnonzero(~low)

    (seen, unseen), (calibrating, _) = split(parts.train), split(parts.calibration)
    judged = parts.test.at(split(parts.test)[1])
    return Trial(
        HURST,
        Parts(
            parts.train.at(seen),
            parts.calibration.at(calibrating),
            parts.test,
            parts.folds[seen],
        ),
        judged,
        parts.train.at(unseen[: judged.size // 2]),
    )
