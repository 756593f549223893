"""Tests of surrogates of the paper preset: on surfaces of the preset, and of other kinds."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.databases import OTHER_SEED, generated
from bench.surrogates.fitting import Parts, read
from gen.database import Reader
from gen.scene import load
from gen.scene.distribution import limits
from learn.arrays import Indices
from learn.dataset import Dataset
from learn.request import Request

HURST_BORDER = 0.7  # surfaces below it train, surfaces above it test
# Of the rows of a test database: what is tried as a cure. The others judge.
MENDING_SHARE = 1 / 3
HOME = "same distribution"  # the case that all others are compared with

HURST = "unseen Hurst"
FINE = "fine grid (257)"


@dataclass(frozen=True)
class Case:
    """A database to test on: its name in tables, its file, and its scene.

    The scene (TOML) holds what differs from the paper preset, but for samples and seed.
    """

    name: str
    file: str
    scene: str


@dataclass(frozen=True, eq=False)
class Trial:
    """Rows of a case with one feature set."""

    name: str  # of the case
    parts: Parts  # what the surrogate on trial is trained on
    judged: Dataset  # rows that judge it
    mending: Dataset | None  # rows of the same kind that it is mended with
    resampled: tuple[Dataset, NDArray[np.float64]] | None = None
    """Rows that judge it with the features of every second node, and the areas solved there [%]."""


def scan_length(side: float, heights: float) -> str:
    """Return the scene of another scan length [um], heights and displacements times a factor."""
    preset = load("paper")
    sigma0 = limits(preset.drawn_parameters["sigma0"])
    pieces = ", ".join(
        f"{{ share = {piece.share!r}, range = {[each * heights for each in limits(piece.range)]} }}"
        for piece in preset.pieces
    )
    return (
        f"[surface]\nside = {side!r}\n"
        f"sigma0 = {[each * heights for each in sigma0]}\n"
        f"[delta]\npieces = [{pieces}]\n"
    )


CASES = (
    Case(FINE, "fine", "[surface]\nnodes = 257\n"),
    Case("midpoint generator", "midpoint", '[surface]\ngenerator = "midpoint"\n'),
    Case("L = 300 um, scaled", "side300-scaled", scan_length(300.0, 0.3)),
    Case("L = 300 um, same heights", "side300", scan_length(300.0, 1.0)),
    Case("L = 0.3 um, scaled", "side0.3-scaled", scan_length(0.3, 0.0003)),
    Case("L = 0.3 um, same heights", "side0.3", scan_length(0.3, 1.0)),
)

# The surfaces of the fine grid at its coarse nodes: surfaces of one seed are nested.
RESAMPLED = Case("every second node", "every-second-node", "")


def databases(folder: Path, rows: int) -> dict[str, Path]:
    """Generate the databases to test on, of some rows each, by the name of their case."""
    head = f"samples = {rows}\nseed = {OTHER_SEED}\n"
    return {
        case.name: generated(folder, case.file, head + case.scene) for case in (*CASES, RESAMPLED)
    }


def trials(request: Request, parts: Parts, tested: dict[str, Path]) -> Iterator[Trial]:
    """Yield every case of a request, the one at home first; databases are by their case's name."""
    yield Trial(HOME, parts, parts.test, None)
    yield unseen_hurst(parts)
    for case in CASES:
        rows = read(replace(request, database=tested[case.name]))
        order = np.random.default_rng(0).permutation(rows.size)
        cut = int(MENDING_SHARE * rows.size)
        judged, coarse = rows.at(np.sort(order[cut:])), None
        if case.name == FINE:
            every = replace(request, database=tested[RESAMPLED.name], area_max=100.0)
            coarse = resampled(judged, read(every))
        yield Trial(case.name, parts, judged, rows.at(order[:cut]), coarse)


def resampled(fine: Dataset, coarse: Dataset) -> tuple[Dataset, NDArray[np.float64]]:
    """Return rows of the fine grid with the coarse one's features, and the areas solved there."""
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
    train, calibration = parts.train.at(seen), parts.calibration.at(calibrating)
    judged = parts.test.at(split(parts.test)[1])
    mending = parts.train.at(unseen[: judged.size // 2])
    return Trial(HURST, Parts(train, calibration, parts.test, parts.folds[seen]), judged, mending)
