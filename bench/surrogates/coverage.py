"""Of the rows that a surrogate does not flag, how many lie inside their interval.

An interval is promised to rows like those of the training, and a flag says which rows are not. So
what counts is the coverage of the rows without a flag: on surfaces, grids and bodies that the
surrogate has not been trained on, and for as many draws of training rows as there are seeds.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.databases import generated
from bench.files import Row, read_toml
from bench.report import Report, remark
from bench.surrogates import kinds
from bench.surrogates.fitting import Fitted, Parts, fit, request_for
from gen.arrays import Indices, Values
from gen.database import Reader
from gen.quantities import FORCE, MEAN_GAP
from gen.runtime.errors import InputError
from gen.runtime.user_code import TRUSTED
from gen.scene import preset_names
from learn import dataset, split
from learn.database_rows import Dataset
from learn.split import FOLDS

HURST_BORDER = 0.7  # surfaces below it train, surfaces above it test
TARGETS = ("area", FORCE.name, MEAN_GAP.name)
FEW = 20  # rows of a finer grid that are learnt together with those of the preset's grid
HARDNESS = (0.006, 0.05)  # over E*, of the rows that train; the preset has 0.003 to 0.1
LEVEL = 0.9  # of the intervals whose coverage is counted
WANTED = 0.86  # smallest coverage of unflagged rows that is asked for, within its standard error
ENOUGH = 30  # unflagged rows, fewer of which tell nothing
FEWEST = 300  # smallest number of rows of the preset

PAPER, MIDPOINT, SPECTRAL, YIELDING = (
    "paper",
    "midpoint",
    "broad-spectral",
    "paper-yielding",
)
FINE = {257: "fine-257", 513: "fine-513"}

STORE = "[store]\nmean_gap = true\n"
SCENES = read_toml("surrogates/scenes")["coverage"]
KIND = "kinds"
"""Name of the cases of kinds of surfaces that train no surrogate."""

FOREIGN = (*SCENES["kinds"], *kinds.NAMES)
"""These kinds; the last four were made when the features stood."""

SHARES = {FINE[257]: 6, FINE[513]: 15, "broad-fine": 6, **dict.fromkeys(FOREIGN, 6)}
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
    """Rows that train a surrogate, and rows of another kind that judge it, by their positions."""

    trained_on: str  # in words
    tested_on: str
    pool: tuple[str, ...]  # databases that are read together
    train: Indices  # rows that are split into training, calibration and test
    judged: Indices | None = (
        None  # rows that judge it; None for the test rows of the split
    )
    added: Indices = field(
        default_factory=lambda: np.empty(0, np.int64)
    )  # further training rows
    flagged: Indices = field(
        default_factory=lambda: np.empty(0, np.int64)
    )  # whatever they are


def databases(folder: Path, rows: int) -> dict[str, Path]:
    """Generate the databases as far as they are missing, by the names of their scenes."""
    texts = {PAPER: "", **SCENES["others"]}
    for name in (YIELDING, *BROAD):
        shipped = (files("gen") / "scenes" / f"{name}.toml").read_text(encoding="utf-8")
        lines = shipped.splitlines(keepends=True)
        texts[name] = "".join(
            each for each in lines if not each.startswith(("title", "samples"))
        )
    for seed, name in enumerate(FOREIGN, 3000):
        surface = SCENES["kinds"].get(name, SCENES["function"].replace("NAME", name))
        texts[name] = f"seed = {seed}\n{surface}{SCENES['load']}"
    TRUSTED.set(True)  # the functions are ours
    counts = {name: max(rows // SHARES.get(name, 1), 40) for name in texts}
    return {
        name: generated(folder, name, f"samples = {counts[name]}\n{text}{STORE}")
        for name, text in texts.items()
    }


def cases(pool: tuple[str, ...], rows: Dataset, seed: int) -> Iterator[Case]:
    """Yield the cases of one pool of databases, whose rows have been read."""
    place = {
        name: np.flatnonzero(rows.database == index) for index, name in enumerate(pool)
    }
    if {*FOREIGN} <= {*pool}:
        foreign = np.concatenate([place[name] for name in FOREIGN])
        trained = "broad" if BROAD[0] in pool else "preset"
        yield Case(
            trained, KIND, pool, np.setdiff1d(np.arange(rows.size), foreign), foreign
        )
    elif pool == (PAPER,):
        yield Case("preset", "preset", pool, place[PAPER])
        low = column(rows, "hurst") <= HURST_BORDER
        words = f"preset, H to {HURST_BORDER:g}", "Hurst exponents above"
        yield Case(*words, pool, np.flatnonzero(low), np.flatnonzero(~low))
    elif pool == (YIELDING,):
        ratio = column(rows, "hardness")  # E* is 1 MPa
        inside = (ratio >= HARDNESS[0]) & (ratio <= HARDNESS[1])
        words = (
            f"preset, hardness {HARDNESS[0]:g} to {HARDNESS[1]:g} E*",
            "other hardness",
        )
        outside = np.flatnonzero(~inside)
        yield Case(*words, pool, np.flatnonzero(inside), outside, flagged=outside)
    elif pool[0] == PAPER:
        other = pool[1]
        yield Case("preset", other, pool, place[PAPER], place[other])
        if other in FINE.values():
            few = np.random.default_rng(seed).permutation(place[other])[:FEW]
            judged = np.setdiff1d(place[other], few)
            both = f"preset and {FEW} rows of {other}"
            yield Case(both, other, pool, place[PAPER], judged, few)
            yield Case(f"{FEW} rows of {other}", other, pool, few, judged)
    else:
        every = np.arange(rows.size)
        yield Case("broad", "broad", pool, every)
        for kind, names in KINDS.items():
            judged = np.sort(np.concatenate([place[name] for name in names]))
            yield Case(
                f"broad without {kind}", kind, pool, np.setdiff1d(every, judged), judged
            )


def column(rows: Dataset, name: str) -> Values:
    """Read a column of the only database of a dataset, at its rows."""
    with Reader(Path(rows.origins[0].database)) as reader:
        return np.asarray(reader.column(name), dtype=np.float64)[rows.rows]


def pools() -> Sequence[tuple[str, ...]]:
    """Return the databases that are read together for the cases."""
    beside = (MIDPOINT, SPECTRAL, *FINE.values())
    elsewhere = (PAPER, *FOREIGN), (*BROAD, *FOREIGN)
    return (
        (PAPER,),
        *((PAPER, other) for other in beside),
        (YIELDING,),
        BROAD,
        *elsewhere,
    )


def coverage(folder: Path, rows: int, seeds: int) -> Report:
    """Judge all cases with each seed, and report rows of all seeds and of the cases.

    The arguments are those of the command.

    An InputError is raised if there are too few rows or seeds.
    """
    if rows < FEWEST or seeds < 1:
        raise InputError(
            f"--rows {rows}, --seeds {seeds}: give {FEWEST} rows and 1 seed or more"
        )
    made = databases(folder / "databases", rows)
    found = []
    for pool in pools():
        for target, read in zip(
            TARGETS, _read(*(made[name] for name in pool)), strict=True
        ):
            for seed in range(seeds):
                for case in cases(pool, read, seed):
                    judged = [
                        {"target": target} | row
                        for row in _judged(case, read, rows, seed)
                    ]
                    share = judged[0]["covered_unflagged"]
                    remark(
                        f"{case.trained_on}: {case.tested_on}, {target}: {share:.1%} in 90 %"
                    )
                    found += judged
    table = pooled(found)
    elsewhere = [row for row in table if not row["tested_on"].startswith(KIND)]
    tables = {"coverage-seeds": found, "coverage": elsewhere, "kinds": by_kind(table)}
    return Report(tables)


REQUEST = replace(request_for(Path(), "kernel-ridge", "hybrid", None), targets=TARGETS)


def _read(*paths: Path) -> list[Dataset]:
    """Read the rows that all targets have, one dataset for each target."""
    return dataset.read(replace(REQUEST, databases=paths))


def _judged(case: Case, rows: Dataset, most: int, seed: int) -> list[Row]:
    """Fit the surrogate of a case and judge it: a row of the table, then one of each scene."""
    parts = _parts(case, rows, most, seed)
    fitted = fit(REQUEST, parts.train, parts.folds)
    judged, always = parts.test, np.zeros(parts.test.size, dtype=bool)
    if case.judged is not None:
        judged, always = rows.at(case.judged), np.isin(case.judged, case.flagged)
    scenes = {case.tested_on: np.arange(judged.size)}
    numbers = np.unique(judged.database) if case.judged is not None else ()
    for number in numbers if len(numbers) > 1 else ():
        name = f"{case.tested_on}: {case.pool[number]}"
        scenes[name] = np.flatnonzero(judged.database == number)
    names = {"trained_on": case.trained_on, "seed": seed, "trained": parts.train.size}
    return [
        {**names, "tested_on": scene, **_scores(fitted, judged.at(own), always[own])}
        for scene, own in scenes.items()
    ]


def _parts(case: Case, rows: Dataset, most: int, seed: int) -> Parts:
    """Split the rows of a case, up to a largest number, and add the rows that train in any case."""
    chosen = np.sort(np.random.default_rng(seed).permutation(case.train)[:most])
    drawn = split.draw(rows.at(chosen), seed)
    train, folds, test = chosen[drawn.train], drawn.folds, rows.at(chosen[drawn.test])
    if case.added.size:
        train = np.append(train, case.added)
        folds = np.append(folds, np.arange(case.added.size) % FOLDS).astype(np.int8)
        order = np.random.default_rng(seed).permutation(
            train.size
        )  # a search sees the first rows
        train, folds = train[order], folds[order]
    return Parts(rows.at(train), test, folds)


def _scores(fitted: Fitted, judged: Dataset, always: NDArray[np.bool_]) -> Row:
    """Return shares and scores of some rows: flagged, covered, and covered where not flagged."""
    low, high = fitted.interval(judged, LEVEL)
    truth = judged.target * judged.scale
    covered = (low <= truth) & (truth <= high)
    flagged = fitted.flags(judged) | always
    kept = ~flagged
    widths = (high - low)[kept].sum() / truth[kept].sum() if kept.any() else np.nan
    return {
        "judged": judged.size,
        "nmae": fitted.scores(judged).nmae,
        "flagged": float(flagged.mean()),
        "covered": float(covered.mean()),
        "unflagged": int(kept.sum()),
        "covered_unflagged": float(covered[kept].mean()) if kept.any() else float("nan"),
        "width": 100 * float(widths),
        "empty": int((high <= low)[kept].sum()),
    }


def pooled(found: Sequence[Row]) -> list[Row]:
    """Return one row for each case: means over the seeds, unflagged rows counted together."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in found:
        key = row["trained_on"], row["tested_on"], row["target"]
        groups.setdefault(key, []).append(row)
    return [_pooled(rows) for rows in groups.values()]


def by_kind(table: Sequence[Row]) -> list[Row]:
    """Return one row for each kind of surfaces, with the coverage and width of all targets."""
    found: dict[tuple[str, str], Row] = {}
    for row in table:
        if row["tested_on"].startswith(KIND):
            kind = row["tested_on"].removeprefix(f"{KIND}: ").replace(KIND, "all")
            names = {
                "trained_on": row["trained_on"],
                "kind": kind,
                "judged": row["judged"],
            }
            counts = {
                "flagged": row["flagged"],
                "unflagged": row["unflagged"],
                "empty": 0,
            }
            own = found.setdefault((row["trained_on"], kind), names | counts)
            own["empty"] += row["empty"]
            own[row["target"]] = row["covered_unflagged"]
            own[f"{row['target']}_width"] = row["width"]
    return list(found.values())


def _pooled(rows: Sequence[Row]) -> Row:
    """Return a row of all seeds of a case."""
    names = ("unflagged", "covered_unflagged", "width", "nmae", "flagged", "covered")
    weights, each, width, *others = (
        np.array([row[name] for row in rows]) for name in names
    )
    share = error = mean_width = float("nan")
    if (some := weights > 0).any():
        share = float(np.average(each[some], weights=weights[some]))
        mean_width = float(np.average(width[some], weights=weights[some]))
        # The seeds judge rows that are alike: no more than one seed's are independent.
        error = float(np.sqrt(share * (1 - share) / weights[some].mean()))
    means = zip(names[3:], (float(mean) for mean in np.mean(others, axis=1)), strict=True)
    return {
        **{name: rows[0][name] for name in ("trained_on", "tested_on", "target")},
        "seeds": len(rows),
        **{name: rows[0][name] for name in ("trained", "judged")},
        **dict(means),
        "unflagged": int(weights.sum()),
        "covered_unflagged": share,
        "error": error,
        "width": mean_width,
        "empty": sum(row["empty"] for row in rows),
        "verdict": verdict(share, error, int(weights.sum())),
    }


def verdict(share: float, error: float, unflagged: int) -> str:
    """Say whether the coverage of unflagged rows is what is asked for, within a standard error."""
    if not unflagged:
        return "all flagged"
    if unflagged < ENOUGH:
        return "few unflagged"
    if share >= WANTED:
        return "met"
    return "met within its error" if share + error >= WANTED else "not met"
