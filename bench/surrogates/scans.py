"""How well a surrogate knows windows of maps: parts that it has not seen, and maps left out.

The twenty made maps of one instrument are read, prepared and cut into windows by a scene as a user
would write it. Kernel ridge with hybrid features, fitted as `learn fit` does, is judged on every
row once: a fifth of the tiles at a time, and one map at a time. No node of a map is in training and
in judgement, and neither are settings, intervals and flags: they come from the other rows.

A row is called wrong if it is further from the prediction than twice as far as its interval
reaches: of normal errors 0.1 % are. A tenth of the rows is announced to be outside the interval;
wrong rows are not, so they have to be flagged, all but the few that chance makes. More would show a
kind of surface that the flags do not tell.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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

LEVEL = 0.9  # of the intervals whose coverage is counted
FEWEST = 200  # smallest number of rows: ten of each map
MISSED = 2.0  # times that a wrong row's error is half the width of its interval, at least

SCENE: str = read_toml("surrogates/scenes")["windows"]["scene"]

PARTS = {"unseen tiles": "tile", "maps left out": "map"}
"""The rows that are left out of the training, and the column that tells them."""


@dataclass(frozen=True, eq=False)
class Judged:
    """All rows of a database, each predicted by a surrogate that has not seen its tile, or map."""

    nodes: int  # a side of the windows
    left_out: str  # a key of `PARTS`
    maps: Indices  # (n,) map of each row
    names: tuple[str, ...]  # of the maps
    truth: Values  # (n,) areas [%]
    prediction: Values
    low: Values  # (n,) ends of the intervals [%]
    high: Values
    flagged: NDArray[np.bool_]

    def row(self, name: str, chosen: NDArray[np.bool_]) -> Row:
        """Score some of the rows, as one row of the table."""
        fields = (self.truth, self.prediction, self.low, self.high)
        truth, prediction, low, high = (each[chosen] for each in fields)
        flagged = self.flagged[chosen]
        covered, root = (low <= truth) & (truth <= high), np.sqrt(prediction)
        wrong = np.abs(np.sqrt(truth) - root) > MISSED * (np.sqrt(high) - root)
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
            "covered_unflagged": _mean(covered[~flagged]),
            "width": float((np.minimum(high, 100.0) - low).mean()),
            "outside_flagged": _mean(flagged[~covered]),
            "wrong": int(wrong.sum()),
            "wrong_flagged": _mean(flagged[wrong]),
            "wrong_unflagged": _mean(wrong[~flagged]),
        }

    def rows(self) -> list[Row]:
        """Return the rows of the table: all maps together, then each."""
        every = np.ones(self.maps.size, dtype=bool)
        each = [
            self.row(name, self.maps == index) for index, name in enumerate(self.names)
        ]
        return [self.row("all", every), *each]


def scans(folder: Path, rows: int, nodes: Sequence[int], seed: int) -> Report:
    """Judge surrogates of windows, on tiles and maps left out; `seed` is that of the fifths.

    Maps and databases are kept in the folder. InputError is raised if there are too few rows, or
    windows larger than the maps.
    """
    if rows < FEWEST:
        raise InputError(f"--rows {rows}: give {FEWEST} or more, ten of each map")
    if not (
        folder / "maps"
    ).is_dir():  # some formats hold the time at which they were written
        write_all(folder / "maps", ONE_INSTRUMENT)
    found = []
    for size in nodes:
        text = f"samples = {rows}\n" + SCENE.replace("nodes = 64", f"nodes = {size}")
        path = generated(folder / "databases", f"windows-{size}", text)
        found += [_judged(path, size, left_out, seed) for left_out in PARTS]
    table = [row for judged in found for row in judged.rows()]
    return Report({"scans": table}, pictures={"scans": picture(found)})


def _judged(path: Path, nodes: int, left_out: str, seed: int) -> Judged:
    """Predict all rows of a database, each by a surrogate of the others."""
    request = request_for(path, "kernel-ridge", "hybrid", None)
    rows = read(request)
    with Reader(path) as reader:
        maps = np.asarray(reader.column("map"), dtype=np.int64)[rows.rows]
        surface = reader.scene.surface
    assert isinstance(surface, ScanSurface)
    names = tuple(Path(each.file).stem for each in surface.recorded_maps().maps)
    prediction, low, high = np.empty((3, rows.size))
    flagged = np.empty(rows.size, dtype=bool)
    for test in _tests(rows, maps, by_map=PARTS[left_out] == "map", seed=seed):
        train, folds = _ordered(rows, np.setdiff1d(np.arange(rows.size), test))
        fitted = fit(request, rows.at(train), folds)
        judged = rows.at(test)
        low[test], high[test] = fitted.interval(judged, LEVEL)
        prediction[test] = fitted.predict(judged)
        flagged[test] = fitted.flags(judged)
    made = Judged(
        nodes, left_out, maps, names, rows.target, prediction, low, high, flagged
    )
    score = scores(made.truth, made.prediction)
    remark(f"{nodes} nodes, {left_out}: R2 {score.r2:.2f} %, nMAE {score.nmae:.2f} %")
    return made


def _tests(
    rows: Dataset, maps: Indices, *, by_map: bool, seed: int = 0
) -> Iterator[Indices]:
    """Yield the rows that are judged together: those of a map, or of a fifth of all tiles."""
    groups = np.random.default_rng(seed).permutation(
        np.unique(maps if by_map else rows.groups)
    )
    for part in np.array_split(groups, groups.size if by_map else FOLDS):
        yield np.flatnonzero(np.isin(maps if by_map else rows.groups, part))


def _ordered(rows: Dataset, kept: Indices) -> tuple[Indices, NDArray[np.int8]]:
    """Return training rows in random order, tiles together, and their folds."""
    groups = rows.groups[kept]
    order = np.random.default_rng(1).permutation(np.unique(groups))
    place = np.zeros(int(rows.groups.max()) + 1, dtype=np.int64)
    place[order] = np.arange(order.size)
    train = kept[np.argsort(place[groups], kind="stable")]
    fold = place[rows.groups[train]] * FOLDS // order.size
    return train, fold.astype(np.int8)


def _mean(values: NDArray[np.bool_]) -> float:
    """Return a share, NaN of nothing."""
    return float(values.mean()) if values.size else float("nan")


def picture(found: Sequence[Judged]) -> Any:
    """Draw prediction over truth, a panel for each study, a colour for each kind of surface."""
    figure = new_figure(5.0 * len(PARTS), 4.4 * (len(found) / len(PARTS)))
    panels = figure.subplots(-(-len(found) // len(PARTS)), len(PARTS), squeeze=False)
    for panel, judged in zip(panels.flat, found, strict=True):
        parity_axes(panel, judged.truth)
        for kind, colour in zip(KINDS, COLOURS, strict=False):
            own = [
                index for index, name in enumerate(judged.names) if name.startswith(kind)
            ]
            here = np.isin(judged.maps, own)
            x, y = judged.truth[here], judged.prediction[here]
            look = {"marker": ".", "ms": 3, "ls": "none", "color": colour}
            draw_parity(panel, x, y, label=kind, **look)
        panel.set(xlabel="solved area [%]", ylabel="predicted area [%]")
        panel.set_title(
            f"{judged.nodes} x {judged.nodes} nodes, {judged.left_out}", fontsize=10
        )
    panels.flat[0].legend(markerscale=3)
    return figure
