"""How well a surrogate predicts windows of maps: of parts that it has not seen, and of other maps.

The twenty made maps of one instrument are read, prepared and cut into windows by a scene that a
user would write. Kernel ridge with hybrid features is fitted as `learn fit` does. It is judged
twice on every row: by a fit without a fifth of the tiles, and by a fit without one map. No node of
a map both trains and judges. Settings, intervals and flags come from the training rows alone.

A row is called wrong if its error is more than twice as large as its interval allows. If errors are
normally distributed, a tenth of the rows is outside the interval, but only 0.1 % of them are wrong.
So wrong rows have to be flagged, except for these few. More unflagged wrong rows would show a kind
of surface that the flags do not recognise.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.databases import generated
from bench.files import Row, read_toml
from bench.made_maps import KINDS, ONE_INSTRUMENT, write_all
from bench.picture import COLOURS, new_figure
from bench.report import Report, remark
from bench.surrogates.fitting import fit, read, request_for
from gen.arrays import Indices, Values
from gen.database import Reader
from gen.generators.scans import ScanSurface
from gen.runtime.errors import InputError
from gen.runtime.figure import draw_parity, parity_axes
from learn.database_rows import Dataset
from learn.metrics import scores
from learn.split import FOLDS

LEVEL = 0.9
"""Level of the intervals, 0 to 1."""

FEWEST = 200
"""Smallest accepted number of rows of a database: ten of each map."""

MISSED = 2.0
"""Error of a row over half the width of its interval, both in roots of areas, above which the row
is called wrong [1]."""

SCENE: str = read_toml("surrogates/scenes")["windows"]["scene"]
"""The scene (TOML) with windows of 64 nodes a side, without its number of rows."""

PARTS = {"unseen tiles": "tile", "maps left out": "map"}
"""The group whose rows are left out of a training together, "tile" or "map", by the words for it in
the table."""


@dataclass(frozen=True, eq=False)
class Judged:
    """All n rows of a database, each predicted by a surrogate without its tile or its map."""

    nodes: int  # nodes a side of the windows
    left_out: str  # rows left out of each training, a key of `PARTS`
    maps: Indices  # (n,) number of the map of each row
    names: tuple[str, ...]  # names of the maps, in the order of their numbers
    truth: Values  # (n,) solved areas [%]
    prediction: Values  # (n,) predicted areas [%]
    low: Values  # (n,) lower ends of the intervals [%]
    high: Values  # (n,) upper ends of the intervals [%]
    flagged: NDArray[np.bool_]  # (n,) True for rows that the surrogate flags

    def row(self, name: str, chosen: NDArray[np.bool_]) -> Row:
        """Score some of the rows.

        Parameters
        ----------
        name : str
            Name of the map, or "all".
        chosen : ndarray of bool, shape (n,)
            True for the rows to score.

        Returns
        -------
        Row
            A row of the table. Scores and the mean width of the intervals are in percent. Shares
            are 0 to 1. A share is NaN if it is of no rows, as that of unflagged rows if all are
            flagged.
        """
        truth = self.truth[chosen]
        prediction = self.prediction[chosen]
        low = self.low[chosen]
        high = self.high[chosen]
        flagged = self.flagged[chosen]
        covered = (low <= truth) & (truth <= high)
        # For roots of areas the intervals are symmetric about the prediction.
        root = np.sqrt(prediction)
        half_width = np.sqrt(high) - root
        wrong = np.abs(np.sqrt(truth) - root) > MISSED * half_width
        judged = scores(truth, prediction)
        return {
            "nodes": self.nodes,
            "left_out": self.left_out,
            "map": name,
            "rows": int(chosen.sum()),
            "area": float(truth.mean()),
            "r2": judged.r2,
            "nmae": judged.nmae,
            "covered": float(covered.mean()),
            "flagged": float(flagged.mean()),
            "covered_unflagged": _share(covered[~flagged]),
            "width": float((np.minimum(high, 100.0) - low).mean()),
            "outside_flagged": _share(flagged[~covered]),
            "wrong": int(wrong.sum()),
            "wrong_flagged": _share(flagged[wrong]),
            "wrong_unflagged": _share(wrong[~flagged]),
        }

    def rows(self) -> list[Row]:
        """Return rows of the table: one for all maps together, then one for each map."""
        all_maps = self.row("all", np.ones(self.maps.size, dtype=bool))
        of_maps = [
            self.row(name, self.maps == number) for number, name in enumerate(self.names)
        ]
        return [all_maps, *of_maps]


def scans(folder: Path, rows: int, nodes: Sequence[int], seed: int) -> Report:
    """Judge surrogates of windows, on tiles and on maps that were left out of the training.

    Progress is printed on standard error.

    Parameters
    ----------
    folder : Path
        Folder of the report. Maps and databases are made in its folders `maps` and `databases` if
        they are missing, and kept.
    rows : int
        Number of rows of each size of windows, `FEWEST` or more.
    nodes : sequence of int
        Nodes a side of the windows, one size or more.
    seed : int
        Seed of the division of the tiles into fifths.

    Returns
    -------
    Report
        Table and picture `scans`.

    Raises
    ------
    InputError
        If there are too few rows, or windows are larger than the maps.
    """
    if rows < FEWEST:
        raise InputError(f"--rows {rows}: give {FEWEST} or more, ten of each map")
    # Some formats hold the time of writing, so that maps written again would be other files than
    # those that the databases name.
    if not (folder / "maps").is_dir():
        write_all(folder / "maps", ONE_INSTRUMENT)
    studies = []
    for size in nodes:
        text = f"samples = {rows}\n" + SCENE.replace("nodes = 64", f"nodes = {size}")
        path = generated(folder / "databases", f"windows-{size}", text)
        studies += [_judged(path, size, left_out, seed) for left_out in PARTS]
    table = [row for study in studies for row in study.rows()]
    return Report({"scans": table}, pictures={"scans": picture(studies)})


def _judged(path: Path, nodes: int, left_out: str, seed: int) -> Judged:
    """Predict all rows of a database, each by a surrogate without its tile or its map.

    `nodes` is the number of nodes a side of the windows, `left_out` a key of `PARTS`.
    """
    request = request_for(path, "kernel-ridge", "hybrid", None)
    rows = read(request)
    recorded = _recorded_maps(path, rows)
    prediction, low, high = np.empty((3, rows.size))
    flagged = np.empty(rows.size, dtype=bool)
    by_map = PARTS[left_out] == "map"
    for test in _tests(rows, recorded.numbers, by_map=by_map, seed=seed):
        training = _ordered(rows, np.setdiff1d(np.arange(rows.size), test))
        fitted = fit(request, rows.at(training.rows), training.folds)
        judged = rows.at(test)
        low[test], high[test] = fitted.interval(judged, LEVEL)
        prediction[test] = fitted.predict(judged)
        flagged[test] = fitted.flags(judged)
    score = scores(rows.target, prediction)
    remark(f"{nodes} nodes, {left_out}: R2 {score.r2:.2f} %, nMAE {score.nmae:.2f} %")
    return Judged(
        nodes=nodes,
        left_out=left_out,
        maps=recorded.numbers,
        names=recorded.names,
        truth=rows.target,
        prediction=prediction,
        low=low,
        high=high,
        flagged=flagged,
    )


class _RecordedMaps(NamedTuple):
    """The maps of n rows of a database."""

    numbers: Indices  # (n,) number of the map of each row
    names: tuple[str, ...]  # names of the maps, in the order of their numbers


def _recorded_maps(path: Path, rows: Dataset) -> _RecordedMaps:
    """Read the map of each row from the database of the rows."""
    with Reader(path) as reader:
        numbers = np.asarray(reader.column("map"), dtype=np.int64)[rows.rows]
        surface = reader.scene.surface
    assert isinstance(surface, ScanSurface)
    names = [Path(recorded.file).stem for recorded in surface.recorded_maps().maps]
    return _RecordedMaps(numbers=numbers, names=tuple(names))


def _tests(
    rows: Dataset, maps: Indices, *, by_map: bool, seed: int = 0
) -> Iterator[Indices]:
    """Yield the positions of the rows that are judged together, each row once.

    They are the rows of one map, or of a random fifth of all tiles. `maps` has the number of the
    map of each row.
    """
    groups = maps if by_map else rows.groups
    shuffled = np.random.default_rng(seed).permutation(np.unique(groups))
    number_of_parts = shuffled.size if by_map else FOLDS
    for part in np.array_split(shuffled, number_of_parts):
        yield np.flatnonzero(np.isin(groups, part))


class _Training(NamedTuple):
    """n training rows in the order of the fit."""

    rows: Indices  # (n,) positions in the dataset
    folds: NDArray[np.int8]  # (n,) fold of each row


def _ordered(rows: Dataset, kept: Indices) -> _Training:
    """Return the training rows at the positions `kept`, in random order of their tiles.

    All rows of a tile are in one fold.
    """
    groups = rows.groups[kept]
    order = np.random.default_rng(1).permutation(np.unique(groups))
    # place[tile] is the place of a tile in the random order.
    place = np.zeros(int(rows.groups.max()) + 1, dtype=np.int64)
    place[order] = np.arange(order.size)
    train = kept[np.argsort(place[groups], kind="stable")]
    folds = place[rows.groups[train]] * FOLDS // order.size
    return _Training(rows=train, folds=folds.astype(np.int8))


def _share(values: NDArray[np.bool_]) -> float:
    """Return the share of True, 0 to 1; NaN for an empty array."""
    if not values.size:
        return float("nan")
    return float(values.mean())


def picture(studies: Sequence[Judged]) -> Any:
    """Draw predicted over solved areas.

    Parameters
    ----------
    studies : sequence of Judged
        For each size of windows, one study for each of `PARTS`.

    Returns
    -------
    matplotlib.figure.Figure
        A panel for each study: a line of panels for each size, with a colour for each kind of
        surface.
    """
    lines = len(studies) // len(PARTS)
    figure = new_figure(5.0 * len(PARTS), 4.4 * lines)
    panels = figure.subplots(lines, len(PARTS), squeeze=False)
    for panel, study in zip(panels.flat, studies, strict=True):
        parity_axes(panel, study.truth)
        for kind, colour in zip(KINDS, COLOURS, strict=False):
            _draw_kind(panel, study, kind, colour)
        panel.set(xlabel="solved area [%]", ylabel="predicted area [%]")
        title = f"{study.nodes} x {study.nodes} nodes, {study.left_out}"
        panel.set_title(title, fontsize=10)
    panels.flat[0].legend(markerscale=3)
    return figure


def _draw_kind(panel: Any, study: Judged, kind: str, colour: str) -> None:
    """Draw the predictions on the maps of one kind of surface as dots.

    The name of a map begins with its kind.
    """
    maps = [number for number, name in enumerate(study.names) if name.startswith(kind)]
    is_of_kind = np.isin(study.maps, maps)
    draw_parity(
        panel,
        study.truth[is_of_kind],
        study.prediction[is_of_kind],
        label=kind,
        marker=".",
        ms=3,
        ls="none",
        color=colour,
    )
