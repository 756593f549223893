"""The training and test rows of the study of coverage: the paper preset and the broad scenes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.databases import generated
from gen.arrays import Values
from gen.database import Reader
from gen.scene import preset_names
from learn.arrays import Indices
from learn.dataset import Dataset

HURST_BORDER = 0.7
"""Surfaces below it train, surfaces above it test."""

FEW = 20
"""Rows of a finer grid that are learnt together with those of the preset's grid."""

HARDNESS = (0.006, 0.05)
"""Hardness over E* of the rows that train; the preset has 0.003 to 0.1."""

PAPER, MIDPOINT, SPECTRAL, YIELDING = "paper", "midpoint", "spectral", "paper-yielding"
FINE = {257: "fine-257", 513: "fine-513"}

OTHERS = {
    MIDPOINT: 'seed = 2026\n[surface]\ngenerator = "midpoint"\n',
    FINE[257]: "seed = 2026\n[surface]\nnodes = 257\n",
    FINE[513]: "seed = 2027\n[surface]\nnodes = 513\n",
}
"""Scenes that differ from the paper preset: none of them has one of its surfaces."""

SHARES = {FINE[257]: 6, FINE[513]: 15, "broad-fine": 6}
"""The rows of the preset over those of a database, where these are fewer."""

BROAD = tuple(name for name in preset_names() if name.startswith("broad-"))
"""The scenes of a surrogate that most surfaces lie inside of."""

KINDS = {
    "midpoint": ("broad-midpoint",),
    "spectra": ("broad-spectral", "broad-spectral-yielding"),
    "diamond-square": ("broad-rmd", "broad-fine", "broad-yielding"),
}
"""Databases of the broad scenes by the kind of their surfaces."""


@dataclass(frozen=True, eq=False)
class Case:
    """Rows that train a surrogate, and rows of another kind that judge it.

    Attributes
    ----------
    trained_on, tested_on : str
        What it is trained and tested on, in words.
    pool : tuple of str
        Databases that are read together.
    train : ndarray of int
        Positions of rows that are split into training, calibration and test.
    judged : ndarray of int, or None
        Positions of the rows that judge it; None for the test rows of the split.
    added : ndarray of int
        Positions of further rows, which all train.
    flagged : ndarray of bool, shape (rows of the pool,)
        Rows that are flagged whatever their features are.
    """

    trained_on: str
    tested_on: str
    pool: tuple[str, ...]
    train: Indices
    judged: Indices | None
    added: Indices
    flagged: NDArray[np.bool_]


def databases(folder: Path, rows: int) -> dict[str, Path]:
    """Generate the databases as far as they are missing, by the names of their scenes."""
    texts = {PAPER: "", **OTHERS}
    texts |= {name: _preset(name) for name in (YIELDING, *BROAD)}
    return {
        name: generated(folder, name, f"samples = {max(rows // SHARES.get(name, 1), 40)}\n{text}")
        for name, text in texts.items()
    }


def _preset(name: str) -> str:
    """Return the text of a shipped scene without its title and samples."""
    lines = (files("gen") / "scenes" / f"{name}.toml").read_text(encoding="utf-8").splitlines()
    kept = (each for each in lines if not each.startswith(("title", "samples")))
    return "\n".join(kept) + "\n"


def cases(pool: tuple[str, ...], rows: Dataset, seed: int) -> Iterator[Case]:
    """Yield the cases of one pool of databases, whose rows have been read."""
    place = {name: np.flatnonzero(rows.database == index) for index, name in enumerate(pool)}
    none, never = np.array([], dtype=np.int64), np.zeros(rows.size, dtype=bool)
    if pool == (PAPER,):
        yield Case("preset", "preset", pool, place[PAPER], None, none, never)
        low = column(rows, "hurst") <= HURST_BORDER
        unseen = np.flatnonzero(~low)
        yield Case(
            f"preset, H to {HURST_BORDER:g}", "Hurst exponents above", pool,
            np.flatnonzero(low), unseen, none, never,
        )  # fmt: skip
    elif pool == (YIELDING,):
        ratio = column(rows, "hardness")  # E* is 1 MPa
        inside = (ratio >= HARDNESS[0]) & (ratio <= HARDNESS[1])
        words = f"preset, hardness {HARDNESS[0]:g} to {HARDNESS[1]:g} E*"
        train, judged = np.flatnonzero(inside), np.flatnonzero(~inside)
        yield Case(words, "other hardness", pool, train, judged, none, ~inside)
    elif pool[0] == PAPER:
        yield from _beside_the_preset(pool, place, seed, never)
    else:
        yield from _of_broad(pool, place, never)


def _beside_the_preset(
    pool: tuple[str, ...], place: dict[str, Indices], seed: int, never: NDArray[np.bool_]
) -> Iterator[Case]:
    """Yield the cases of the preset and one other database."""
    other, none = pool[1], np.array([], dtype=np.int64)
    yield Case("preset", other, pool, place[PAPER], place[other], none, never)
    if other in FINE.values():
        few = np.random.default_rng(seed).permutation(place[other])[:FEW]
        judged = np.setdiff1d(place[other], few)
        words = f"preset and {FEW} rows of {other}"
        yield Case(words, other, pool, place[PAPER], judged, few, never)
        yield Case(f"{FEW} rows of {other}", other, pool, few, judged, none, never)


def _of_broad(
    pool: tuple[str, ...], place: dict[str, Indices], never: NDArray[np.bool_]
) -> Iterator[Case]:
    """Yield the cases of the broad scenes: all together, and each kind left out."""
    every, none = np.arange(never.size), np.array([], dtype=np.int64)
    yield Case("broad", "broad", pool, every, None, none, never)
    for kind, names in KINDS.items():
        judged = np.concatenate([place[name] for name in names])
        train = np.setdiff1d(every, judged)
        yield Case(f"broad without {kind}", kind, pool, train, np.sort(judged), none, never)


def column(rows: Dataset, name: str) -> Values:
    """Read a column of the only database of a dataset, at its rows."""
    with Reader(Path(rows.origins[0].database)) as reader:
        return np.asarray(reader.column(name), dtype=np.float64)[rows.rows]


def pools() -> Sequence[tuple[str, ...]]:
    """Return the databases that are read together for the cases."""
    beside = (MIDPOINT, "broad-spectral", *FINE.values())
    return ((PAPER,), *((PAPER, other) for other in beside), (YIELDING,), BROAD)
