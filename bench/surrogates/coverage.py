"""The share of rows inside their interval, among the rows that a surrogate does not flag.

The level of an interval is promised for rows that resemble the training rows. A flag marks the
other rows. So the share of rows inside their interval (the coverage) has to be the level for rows
without a flag: on surfaces, grids and bodies that the surrogate has not been trained on, and for
several draws of the training rows.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.databases import generated, preset_text
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

HURST_BORDER = 0.7
"""Hurst exponent up to which surfaces train in one case; surfaces above it test."""

TARGETS = ("area", FORCE.name, MEAN_GAP.name)
"""Names of the targets, each with a surrogate of its own."""

FEW = 20
"""Number of rows of a finer grid that train a surrogate, alone or together with the preset."""

HARDNESS = (0.006, 0.05)
"""Smallest and largest hardness over E* of the rows that train in one case [1]. The preset has
0.003 to 0.1."""

LEVEL = 0.9
"""Level of the intervals, 0 to 1."""

REQUIRED = 0.86
"""Smallest coverage of unflagged rows that meets the promise, 0 to 1. A coverage that is lower by
up to one standard error meets it "within its error"."""

ENOUGH = 30
"""Smallest number of unflagged rows whose coverage is judged as met or not."""

FEWEST = 300
"""Smallest accepted number of rows of the preset."""

FEWEST_OF_DATABASE = 40
"""Smallest number of rows that are generated for a database."""

PAPER = "paper"
"""Name of the paper preset's database."""

MIDPOINT = "midpoint"
"""Name of the database of the paper preset with the generator "midpoint"."""

SPECTRAL = "broad-spectral"
"""Name of the database of broad spectral surfaces."""

YIELDING = "paper-yielding"
"""Name of the preset, and of its database, that is the paper preset with bodies that yield."""

FINE = {257: "fine-257", 513: "fine-513"}
"""Names of the databases of finer grids, by their nodes a side."""

STORE = "[store]\nmean_gap = true\n"
"""Table (TOML) that is added to every scene, because the mean gap is a target."""

SCENES = read_toml("surrogates/scenes")["coverage"]
"""Texts (TOML) of the scenes of this study. `others` and `kinds` are tables of scenes by their
names; `function` and `load` are parts of scenes."""

KIND = "kinds"
"""Value of `tested_on` for cases that are tested on kinds of surfaces which train no surrogate. In
rows about one kind it is "kinds: NAME"."""

FOREIGN = (*SCENES["kinds"], *kinds.NAMES)
"""Names of the kinds of surfaces that train no surrogate, and of their databases. The last four
were made after the features had been chosen, so that they test the features independently."""

SHARES = {FINE[257]: 6, FINE[513]: 15, "broad-fine": 6, **dict.fromkeys(FOREIGN, 6)}
"""Number of rows of the preset over the number of rows of a database, by the database's name. Other
databases have as many rows as the preset."""

BROAD = tuple(name for name in preset_names() if name.startswith("broad-"))
"""Names of the presets with many kinds of surfaces, which train a surrogate together."""

KINDS = {
    "midpoint": ("broad-midpoint",),
    "spectra": ("broad-spectral", "broad-spectral-yielding"),
    "diamond-square": ("broad-rmd", "broad-fine", "broad-yielding"),
}
"""Names of the broad scenes by the kind of their surfaces."""


def _no_rows() -> Indices:
    """Return an empty array of positions in a dataset."""
    return np.empty(0, np.int64)


@dataclass(frozen=True, eq=False)
class Case:
    """Rows that train a surrogate, and rows that judge it, by their positions in a dataset."""

    trained_on: str  # description of the rows that train, for the table
    tested_on: str  # description of the rows that judge, for the table
    pool: tuple[str, ...]  # names of the databases of the dataset
    train: Indices  # rows that are drawn from, and split into training and test rows
    judged: Indices | None = None  # rows that judge; None for the test rows of the split
    # Further training rows, which are all used.
    added: Indices = field(default_factory=_no_rows)
    # Rows of `judged` that are taken as flagged, whether or not the surrogate flags them.
    flagged: Indices = field(default_factory=_no_rows)


def databases(folder: Path, rows: int) -> dict[str, Path]:
    """Generate the databases of the study that are missing.

    This marks Python functions of scenes as trusted for the rest of the process: the kinds of
    surfaces are such functions.

    Parameters
    ----------
    folder : Path
        Folder of the databases.
    rows : int
        Number of rows of the preset. Databases in `SHARES` get fewer rows.

    Returns
    -------
    dict
        Paths of the databases by the names of their scenes.
    """
    texts = {PAPER: "", **SCENES["others"]}  # without text, a scene is the paper preset
    for name in (YIELDING, *BROAD):
        texts[name] = preset_text(name)
    for seed, name in enumerate(FOREIGN, start=3000):
        surface_of_function = SCENES["function"].replace("NAME", name)
        surface = SCENES["kinds"].get(name, surface_of_function)
        texts[name] = f"seed = {seed}\n{surface}{SCENES['load']}"
    TRUSTED.set(True)
    paths = {}
    for name, text in texts.items():
        number = max(rows // SHARES.get(name, 1), FEWEST_OF_DATABASE)
        paths[name] = generated(folder, name, f"samples = {number}\n{text}{STORE}")
    return paths


def cases(pool: tuple[str, ...], rows: Dataset, seed: int) -> Iterator[Case]:
    """Yield the cases of a pool of databases.

    Parameters
    ----------
    pool : tuple of str
        Names of the databases, one of `pools`.
    rows : Dataset
        Rows of all databases of the pool.
    seed : int
        Seed of the draw of training rows from finer grids.

    Yields
    ------
    Case
        Rows that train and rows that judge.
    """
    if {*FOREIGN} <= {*pool}:  # all of them, with the preset or the broad scenes
        yield _case_of_kinds(pool, rows)
    elif pool == (PAPER,):
        yield from _cases_of_preset(pool, rows)
    elif pool == (YIELDING,):
        yield _case_of_hardness(pool, rows)
    elif pool[0] == PAPER:  # the preset and one other database
        yield from _cases_beside_preset(pool, rows, seed)
    else:
        yield from _cases_of_broad_scenes(pool, rows)


def _rows_of(pool: tuple[str, ...], rows: Dataset, names: Sequence[str]) -> Indices:
    """Return the positions of the rows of the named databases of a pool, database by database."""
    return np.concatenate(
        [np.flatnonzero(rows.database == pool.index(name)) for name in names]
    )


def _case_of_kinds(pool: tuple[str, ...], rows: Dataset) -> Case:
    """Return the case that is judged by all kinds of surfaces which train no surrogate.

    The other databases of the pool train: the preset, or the broad scenes.
    """
    foreign = _rows_of(pool, rows, FOREIGN)
    trained_on = "preset"
    if BROAD[0] in pool:
        trained_on = "broad"
    return Case(
        trained_on=trained_on,
        tested_on=KIND,
        pool=pool,
        train=np.setdiff1d(np.arange(rows.size), foreign),
        judged=foreign,
    )


def _cases_of_preset(pool: tuple[str, ...], rows: Dataset) -> Iterator[Case]:
    """Yield the cases of the preset alone: judged by test rows, and by larger Hurst exponents."""
    preset = _rows_of(pool, rows, [PAPER])
    yield Case(trained_on="preset", tested_on="preset", pool=pool, train=preset)
    is_low = column(rows, "hurst") <= HURST_BORDER
    yield Case(
        trained_on=f"preset, H to {HURST_BORDER:g}",
        tested_on="Hurst exponents above",
        pool=pool,
        train=np.flatnonzero(is_low),
        judged=np.flatnonzero(~is_low),
    )


def _case_of_hardness(pool: tuple[str, ...], rows: Dataset) -> Case:
    """Return the case of `YIELDING` whose judging rows are harder or softer than its training rows.

    All rows that judge are taken as flagged, because they are outside the range of the training.
    """
    smallest, largest = HARDNESS
    hardness = column(rows, "hardness")  # over E*, which is 1 MPa
    is_inside = (hardness >= smallest) & (hardness <= largest)
    outside = np.flatnonzero(~is_inside)
    return Case(
        trained_on=f"preset, hardness {smallest:g} to {largest:g} E*",
        tested_on="other hardness",
        pool=pool,
        train=np.flatnonzero(is_inside),
        judged=outside,
        flagged=outside,
    )


def _cases_beside_preset(
    pool: tuple[str, ...], rows: Dataset, seed: int
) -> Iterator[Case]:
    """Yield the cases that are judged by the second database of a pool; the first is the preset.

    The preset trains. If the second database has a finer grid, there are two more cases: the preset
    and `FEW` rows of the finer grid train, or these rows alone.
    """
    name = pool[1]
    preset = _rows_of(pool, rows, [PAPER])
    of_database = _rows_of(pool, rows, [name])
    yield Case(
        trained_on="preset", tested_on=name, pool=pool, train=preset, judged=of_database
    )
    if name not in FINE.values():
        return
    few = np.random.default_rng(seed).permutation(of_database)[:FEW]
    judged = np.setdiff1d(of_database, few)
    yield Case(
        trained_on=f"preset and {FEW} rows of {name}",
        tested_on=name,
        pool=pool,
        train=preset,
        judged=judged,
        added=few,
    )
    yield Case(
        trained_on=f"{FEW} rows of {name}",
        tested_on=name,
        pool=pool,
        train=few,
        judged=judged,
    )


def _cases_of_broad_scenes(pool: tuple[str, ...], rows: Dataset) -> Iterator[Case]:
    """Yield the cases of the broad scenes.

    In the first, all of them train, and test rows judge. In each of the others, one kind of
    surfaces judges, and the other kinds train.
    """
    all_rows = np.arange(rows.size)
    yield Case(trained_on="broad", tested_on="broad", pool=pool, train=all_rows)
    for kind, names in KINDS.items():
        judged = np.sort(_rows_of(pool, rows, names))
        yield Case(
            trained_on=f"broad without {kind}",
            tested_on=kind,
            pool=pool,
            train=np.setdiff1d(all_rows, judged),
            judged=judged,
        )


def column(rows: Dataset, name: str) -> Values:
    """Read a column of the database at the rows of a dataset.

    Parameters
    ----------
    rows : Dataset
        n rows of one database.
    name : str
        Name of the column.

    Returns
    -------
    ndarray, shape (n,)
        Values, in the unit of the column.
    """
    with Reader(Path(rows.origins[0].database)) as reader:
        return np.asarray(reader.column(name), dtype=np.float64)[rows.rows]


def pools() -> Sequence[tuple[str, ...]]:
    """List the databases that are read together for the cases.

    Returns
    -------
    sequence of tuples of str
        Names of the databases of each pool.
    """
    beside_preset = (MIDPOINT, SPECTRAL, *FINE.values())
    return (
        (PAPER,),
        *((PAPER, name) for name in beside_preset),
        (YIELDING,),
        BROAD,
        (PAPER, *FOREIGN),
        (*BROAD, *FOREIGN),
    )


def coverage(folder: Path, rows: int, seeds: int) -> Report:
    """Measure the coverage of intervals for all cases, targets and seeds.

    Progress is printed on standard error. Python functions of scenes are trusted for the rest of
    the process, see `databases`.

    Parameters
    ----------
    folder : Path
        Folder of the report. Databases are generated in its folder `databases`, and kept.
    rows : int
        Number of rows of each database (fewer for those in `SHARES`), and the largest number of
        rows that are drawn to train and test a surrogate; `FEWEST` or more.
    seeds : int
        Number of draws of the training rows, 1 or more.

    Returns
    -------
    Report
        Table `coverage-seeds` with a row for each case, target and seed, and for each kind of
        surfaces of a case that is judged by several. Tables `coverage` and `kinds` have means over
        the seeds. `kinds` has the cases that are tested on kinds of surfaces which train no
        surrogate, `coverage` the other cases.

    Raises
    ------
    InputError
        If there are too few rows or seeds.
    """
    if rows < FEWEST or seeds < 1:
        raise InputError(
            f"--rows {rows}, --seeds {seeds}: give {FEWEST} rows and 1 seed or more"
        )
    paths = databases(folder / "databases", rows)
    judged: list[Row] = []
    for pool in pools():
        datasets = _read(*(paths[name] for name in pool))
        for target, of_target in zip(TARGETS, datasets, strict=True):
            for seed in range(seeds):
                judged += _judged_pool(
                    pool, of_target, target=target, row_limit=rows, seed=seed
                )
    table = pooled(judged)
    return Report(
        {
            "coverage-seeds": judged,
            "coverage": [row for row in table if not row["tested_on"].startswith(KIND)],
            "kinds": by_kind(table),
        }
    )


def _judged_pool(
    pool: tuple[str, ...], rows: Dataset, target: str, row_limit: int, seed: int
) -> list[Row]:
    """Return the rows of `coverage-seeds` for the cases of a pool, one target and one seed.

    The coverage of each case is printed on standard error.
    """
    judged: list[Row] = []
    for case in cases(pool, rows, seed):
        of_case = [
            {"target": target, **row} for row in _judged(case, rows, row_limit, seed)
        ]
        share = of_case[0]["covered_unflagged"]  # of all rows that judge
        remark(
            f"{case.trained_on}: {case.tested_on}, {target}: {share:.1%} in {100 * LEVEL:g} %"
        )
        judged += of_case
    return judged


REQUEST = replace(request_for(Path(), "kernel-ridge", "hybrid", None), targets=TARGETS)
"""The request for the surrogates of all targets, without databases."""


def _read(*paths: Path) -> list[Dataset]:
    """Read databases together: one dataset for each target, with the rows that all targets have."""
    return dataset.read(replace(REQUEST, databases=paths))


def _judged(case: Case, rows: Dataset, row_limit: int, seed: int) -> list[Row]:
    """Fit the surrogate of a case to `row_limit` rows or fewer, and judge it.

    The first returned row scores all rows that judge. If they are from several databases, a row for
    each database follows, whose `tested_on` is that of the case, a colon and the database.
    """
    parts = _parts(case, rows, row_limit, seed)
    fitted = fit(REQUEST, parts.train, parts.folds)
    names = {"trained_on": case.trained_on, "seed": seed, "trained": parts.train.size}
    if case.judged is None:
        flagged = np.zeros(parts.test.size, dtype=bool)
        scores = _scores(fitted, parts.test, flagged)
        return [{**names, "tested_on": case.tested_on, **scores}]
    judged = rows.at(case.judged)
    flagged = np.isin(case.judged, case.flagged)
    # Positions among the rows that judge, by the description of what they test.
    scored = {case.tested_on: np.arange(judged.size)}
    numbers = np.unique(judged.database)
    if len(numbers) > 1:
        for number in numbers:
            tested_on = f"{case.tested_on}: {case.pool[number]}"
            scored[tested_on] = np.flatnonzero(judged.database == number)
    table = []
    for tested_on, places in scored.items():
        scores = _scores(fitted, judged.at(places), flagged[places])
        table.append({**names, "tested_on": tested_on, **scores})
    return table


def _parts(case: Case, rows: Dataset, row_limit: int, seed: int) -> Parts:
    """Draw `row_limit` rows of `case.train`, or all if there are fewer, and split them.

    `case.added` are added to the training rows, at random places, and have folds in turn. One seed
    draws the rows, the split and the places.
    """
    chosen = np.sort(np.random.default_rng(seed).permutation(case.train)[:row_limit])
    drawn = split.draw(rows.at(chosen), seed)
    train = chosen[drawn.train]
    folds = drawn.folds
    if case.added.size:
        train = np.append(train, case.added)
        folds = np.append(folds, np.arange(case.added.size) % FOLDS).astype(np.int8)
        # A search may use the first rows only, so that the added rows have to be spread over all.
        order = np.random.default_rng(seed).permutation(train.size)
        train = train[order]
        folds = folds[order]
    return Parts(train=rows.at(train), test=rows.at(chosen[drawn.test]), folds=folds)


def _scores(fitted: Fitted, judged: Dataset, always: NDArray[np.bool_]) -> Row:
    """Return the scores of a fitted surrogate on the rows `judged`, as columns of the table.

    `always`, (n,), marks rows that are taken as flagged even if the surrogate does not flag them.
    The columns are:

    - `judged`: number of rows.
    - `nmae`: normalised mean absolute error on all rows [%].
    - `flagged`, `covered`: shares of all rows that are flagged, and whose target is in the interval
      [1].
    - `unflagged`: number of rows that are not flagged. The columns below are about these rows.
    - `covered_unflagged`: share whose target is in the interval, NaN if all rows are flagged [1].
    - `width`: mean width of the intervals over the mean target, NaN if all rows are flagged [%].
    - `empty`: number of intervals without width.
    """
    low, high = fitted.interval(judged, LEVEL)
    truth = judged.target * judged.scale  # in the unit of the intervals
    covered = (low <= truth) & (truth <= high)
    flagged = fitted.flags(judged) | always
    kept = ~flagged
    covered_unflagged = float("nan")
    width = float("nan")
    if kept.any():
        covered_unflagged = float(covered[kept].mean())
        width = float((high - low)[kept].sum() / truth[kept].sum())
    return {
        "judged": judged.size,
        "nmae": fitted.scores(judged).nmae,
        "flagged": float(flagged.mean()),
        "covered": float(covered.mean()),
        "unflagged": int(kept.sum()),
        "covered_unflagged": covered_unflagged,
        "width": 100 * width,
        "empty": int((high <= low)[kept].sum()),
    }


def pooled(judged: Sequence[Row]) -> list[Row]:
    """Average the scores of each case over the seeds.

    In the means of coverage and width of unflagged rows, the weight of a seed is the number of its
    unflagged rows.

    Parameters
    ----------
    judged : sequence of Row
        Rows of the table `coverage-seeds`.

    Returns
    -------
    list of Row
        One row for each `trained_on`, `tested_on` and target, with a verdict.
    """
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in judged:
        key = (row["trained_on"], row["tested_on"], row["target"])
        groups.setdefault(key, []).append(row)
    return [_pooled(rows) for rows in groups.values()]


def by_kind(table: Sequence[Row]) -> list[Row]:
    """Put the rows of all targets about one kind of surfaces into one row.

    Parameters
    ----------
    table : sequence of Row
        Rows of `pooled`. Rows whose `tested_on` is neither "kinds" (for all kinds together) nor
        "kinds: NAME" are left out.

    Returns
    -------
    list of Row
        One row for each training and kind ("all" for all kinds together). The column TARGET is the
        coverage of unflagged rows (0 to 1), and TARGET_width the width of their intervals [%].
        `judged`, `flagged` and `unflagged` are of the first target; `empty` is the sum over the
        targets.
    """
    rows: dict[tuple[str, str], Row] = {}
    for row in table:
        tested_on = row["tested_on"]
        if not tested_on.startswith(KIND):
            continue
        kind = "all"
        if tested_on != KIND:
            kind = tested_on.removeprefix(f"{KIND}: ")
        new_row = {
            "trained_on": row["trained_on"],
            "kind": kind,
            "judged": row["judged"],
            "flagged": row["flagged"],
            "unflagged": row["unflagged"],
            "empty": 0,
        }
        # The row of an earlier target, or the new one.
        of_kind = rows.setdefault((row["trained_on"], kind), new_row)
        of_kind["empty"] += row["empty"]
        of_kind[row["target"]] = row["covered_unflagged"]
        of_kind[f"{row['target']}_width"] = row["width"]
    return list(rows.values())


def _pooled(rows: Sequence[Row]) -> Row:
    """Return the row for all seeds of a case and target, from one row for each seed.

    Counts of unflagged and empty rows are summed, scores are averaged. The numbers of training and
    judging rows are those of the first seed.
    """

    def values(name: str) -> Values:
        """Return a column: its value for each seed."""
        return np.array([row[name] for row in rows])

    first = rows[0]
    unflagged = values("unflagged")
    mean_coverage = _Coverage.of(
        unflagged=unflagged, shares=values("covered_unflagged"), widths=values("width")
    )
    return {
        "trained_on": first["trained_on"],
        "tested_on": first["tested_on"],
        "target": first["target"],
        "seeds": len(rows),
        "trained": first["trained"],
        "judged": first["judged"],
        "nmae": float(values("nmae").mean()),
        "flagged": float(values("flagged").mean()),
        "covered": float(values("covered").mean()),
        "unflagged": int(unflagged.sum()),
        "covered_unflagged": mean_coverage.share,
        "error": mean_coverage.error,
        "width": mean_coverage.width,
        "empty": sum(row["empty"] for row in rows),
        "verdict": verdict(
            mean_coverage.share, mean_coverage.error, unflagged=int(unflagged.sum())
        ),
    }


@dataclass(frozen=True)
class _Coverage:
    """The coverage of the rows without a flag, over all seeds. NaN if all rows are flagged."""

    share: float  # share of rows inside their interval, 0 to 1
    error: float  # standard error of the share
    width: float  # mean width of the intervals over the mean target [%]

    @classmethod
    def of(cls, unflagged: Values, shares: Values, widths: Values) -> "_Coverage":
        """Average over the seeds; each array has one value for each seed.

        `unflagged` has the numbers of unflagged rows, `shares` their coverage and `widths` the
        widths [%], which are NaN for a seed without unflagged rows.
        """
        has_rows = unflagged > 0
        if not has_rows.any():
            return cls(share=float("nan"), error=float("nan"), width=float("nan"))
        weights = unflagged[has_rows]
        share = float(np.average(shares[has_rows], weights=weights))
        # All seeds judge similar rows. The number of independent rows is therefore taken as the
        # mean number of unflagged rows of a seed.
        error = float(np.sqrt(share * (1 - share) / weights.mean()))
        width = float(np.average(widths[has_rows], weights=weights))
        return cls(share=share, error=error, width=width)


def verdict(share: float, error: float, unflagged: int) -> str:
    """Judge the coverage of the rows without a flag.

    Parameters
    ----------
    share : float
        Share of these rows inside their interval, 0 to 1.
    error : float
        Standard error of the share, 0 to 1.
    unflagged : int
        Number of these rows.

    Returns
    -------
    str
        "met", "met within its error" or "not met"; "all flagged" or "few unflagged" if there are
        fewer than `ENOUGH` unflagged rows to judge by.
    """
    if not unflagged:
        return "all flagged"
    if unflagged < ENOUGH:
        return "few unflagged"
    if share >= REQUIRED:
        return "met"
    if share + error >= REQUIRED:
        return "met within its error"
    return "not met"
