"""The search: one factor after the other, its best level kept, until nothing is nearer.

Coordinate descent finds a reading that no other level of a single factor betters; it does not try
all readings. Each is judged on models that fit in seconds.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bench.files import is_there
from bench.paper.nearest.baselines import SEED, baseline
from bench.paper.nearest.candidates import Candidate, Factor, first
from bench.paper.nearest.distance import of_table_1, of_table_4
from bench.paper.nearest.population import Population, Rows, TooFew, population, rows_of
from bench.report import remark
from bench.table import read_table, write_table
from gen.runtime.errors import InputError
from learn.metrics import Scores
from learn.models import MODELS

QUICK: Mapping[str, int | None] = {
    "decision-tree": None,
    "adaboost": None,
    "xgboost": None,
    "gaussian-process": 3000,
    "kernel-ridge": None,
}
"""Models that judge all readings, with the largest number of their training rows, if any."""

TABLE = "search.csv"
FINALISTS = 3  # readings that are judged on several splits
SEEDS = (SEED, SEED + 1, SEED + 2)  # of these splits
FEWER_ROWS = 0.9  # share of the rows that is tried where the surfaces do not suffice
DIGITS = 6  # of the numbers in the tables

COLUMNS = "rows", "area_mean", "area_deviation", "table_1", "table_4", "distance"
"""Numbers of a reading that the search writes down, besides its scores."""


@dataclass(eq=False)
class Search:
    """A search whose readings are kept in a table, so that it goes on where it was stopped.

    Attributes
    ----------
    folder : Path
        Place of the populations and of the table, search.csv.
    rows : int
        Rows of each database.
    surfaces : int
        Surfaces of each population.
    deadline : float
        Time of `time.monotonic` after which no reading is begun [s].
    """

    folder: Path
    rows: int
    surfaces: int
    deadline: float
    found: dict[tuple[str, ...], dict[str, Any]] = field(default_factory=dict)
    tried: dict[Candidate, None] = field(default_factory=dict)
    _populations: dict[str, Population] = field(default_factory=dict)

    def nearest(self, factors: tuple[Factor, ...]) -> tuple[Candidate, bool]:
        """Return the nearest reading, and whether no single level is nearer.

        False means that the time was over before that was known.
        """
        best, settled = first(factors), 0
        distance = self.judge(best)["distance"]
        while settled < len(factors):
            for place in range(len(factors)):
                at_hand = best
                for other in at_hand.neighbours(place):
                    if time.monotonic() > self.deadline and not self._known(other):
                        return best, False
                    found = self.judge(other)["distance"]
                    if found < distance:
                        best, distance = other, found
                settled = 1 if best != at_hand else settled + 1
                if settled == len(factors):
                    break
        return best, True

    def finalists(self) -> list[dict[str, Any]]:
        """Judge the nearest readings of this search on several splits; the nearest one first."""
        nearest = sorted(self.tried, key=lambda each: float(self.judge(each)["distance"]))
        found = []
        for candidate in nearest[:FINALISTS]:
            judged_ = [self.judge(candidate, seed) for seed in SEEDS]
            distances = {f"seed_{n}": round(row["distance"], 4) for n, row in enumerate(judged_)}
            mean = sum(distances.values()) / len(SEEDS)
            found.append(candidate.texts() | distances | {"mean": round(mean, 4)})
        return sorted(found, key=lambda row: float(row["mean"]))

    def judge(self, candidate: Candidate, seed: int = SEED) -> dict[str, Any]:
        """Return the numbers of a reading, and of a seed of its split.

        Those that the table does not have are measured.
        """
        texts = self._texts(candidate, seed)
        key = tuple(texts.values())
        self.tried.setdefault(candidate)
        if not self._known(candidate, seed):
            rows = self.database(candidate)
            split = candidate.value("split")
            scores = {name: baseline(name, rows, split, seed, most) for name, most in QUICK.items()}
            self.found[key] = texts | judged(rows, scores)
            written = (list(row.values()) for row in self.found.values())
            write_table(self.folder / TABLE, self.found[key], written, DIGITS)
            said = ", ".join(candidate.texts().values())
            remark(f"{len(self.found)}: {self.found[key]['distance']:.4f} {said}")
        return self.found[key]

    def _known(self, candidate: Candidate, seed: int = SEED) -> bool:
        """Say whether the table has a reading."""
        texts = self._texts(candidate, seed)
        if not self.found:
            self.found = self._read([*texts])
        return tuple(texts.values()) in self.found

    def _texts(self, candidate: Candidate, seed: int) -> dict[str, str]:
        asked = {"asked": f"{self.rows} of {self.surfaces}", "seed": f"{seed}"}
        return asked | candidate.texts()

    def database(self, candidate: Candidate) -> Rows:
        """Return the rows of a reading, as many as the population has surfaces for."""
        kernel = candidate.value("kernel")
        if kernel not in self._populations:
            place = self.folder / "surfaces"
            self._populations[kernel] = population(place, kernel, self.surfaces)
        loads = int(candidate.value("loads"))
        samples = min(self.rows, self.surfaces * loads)
        while True:
            try:
                return rows_of(candidate.scene(samples), self._populations[kernel])
            except TooFew:
                samples = int(FEWER_ROWS * samples)
                if samples < loads:
                    raise

    def _read(self, wanted: list[str]) -> dict[tuple[str, ...], dict[str, Any]]:
        """Read what an earlier run has written down, of the same factors."""
        path = self.folder / TABLE
        if not is_there(path):
            return {}
        header, rows = read_table(path)
        texts = header[: header.index(COLUMNS[0])]
        if texts != wanted:
            raise InputError(f"{path}: is of other factors ({', '.join(texts)}): move it away")
        numbers = header[len(texts) :]
        return {
            tuple(row[text] for text in texts): row | {each: float(row[each]) for each in numbers}
            for row in rows
        }


def judged(rows: Rows, scores: Mapping[str, Scores]) -> dict[str, float]:
    """Return the numbers of a database and its baselines, by the names of the columns."""
    area, ends, errors = rows.target, of_table_1(rows.columns), of_table_4(scores)
    values = area.size, float(area.mean()), float(area.std()), ends, errors, ends + errors
    found = dict(zip(COLUMNS, values, strict=True))
    for model in (name for name in MODELS if name in scores):
        for error in ("nmse", "nmae", "nmaxe", "r2"):
            found[f"{model}_{error}"] = getattr(scores[model], error)
    return found
