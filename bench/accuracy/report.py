"""The report `accuracy`: errors asked for and got, and times beside those of other solvers.

It has three studies, each of which can be left out:

- `asked`: the errors that were asked for and got on contacts of all kinds, without times;
- `times`: the time to an area within an error, of `bem.solve_within` and of other solvers;
- `full`: the time of full grids over that of `bem.solve_within`.
"""

from collections.abc import Sequence
from pathlib import Path

from bench.accuracy import full_grid, summary, times
from bench.accuracy.asked import asked_and_got
from bench.accuracy.promises import promises
from bench.accuracy.surfaces import MeasuredMap, read_maps
from bench.files import Row
from bench.report import Report
from gen.runtime.errors import InputError

FEWEST_NODES = 64
"""Fewest nodes a side of a full grid, because its shortest wave may have 64 nodes."""

STUDIES = ("asked", "times", "full")
"""Names of the studies."""


def accuracy(
    contacts: int,
    surfaces: int,
    waves: Sequence[int],
    largest: int,
    nodes: Sequence[int],
    large_maps: int,
    processes: int,
    maps: Path | None,
    kinds: Sequence[str],
    of: Sequence[str],
) -> Report:
    """Make the tables of the studies, and print their progress on standard error.

    Parameters
    ----------
    contacts : int
        Contacts of each kind in study `asked`.
    surfaces : int
        Surfaces of each number of waves in study `times`.
    waves : sequence of int
        Periods of the shortest wave on a side in study `times`.
    largest : int
        Most nodes a side of the grids that other solvers solve in study `times`.
    nodes : sequence of int
        Nodes a side of the maps in study `full`, rising.
    large_maps : int
        Number of maps of the first size in `nodes`; each next size has half as many, at least 1.
    processes : int
        Processes that share study `asked`, which takes no times.
    maps : Path or None
        Folder of measured maps for study `asked`.
    kinds : sequence of str
        Names of the kinds of surfaces in study `asked`; all of them if there are none.
    of : sequence of str
        Names of the studies; all of them if there are none.

    Returns
    -------
    Report
        Tables `promises`, `asked`, `answers`, `bars`, `contacts`, `ratios`, `curves`, `times`,
        `full` and `full-maps`; those of a study that was left out are empty.

    Raises
    ------
    InputError
        If there is no such study or kind, a surface has no wave, a map has fewer than
        `FEWEST_NODES` nodes a side, or no map of the folder can be read.
    """
    _check(waves, nodes, of)
    studies = of or STUDIES
    measured: list[MeasuredMap] = []
    if maps is not None and "asked" in studies:
        measured = read_maps(maps)
    asked_rows: list[Row] = []
    timed_rows: list[Row] = []
    rows_of_full_grids: list[Row] = []
    if "times" in studies:
        timed_rows = times.time_to_area(waves, surfaces, largest)
    if "full" in studies:
        numbers = [max(large_maps // 2**place, 1) for place in range(len(nodes))]
        rows_of_full_grids = full_grid.full_grid(nodes, numbers)
    if "asked" in studies:
        asked_rows = asked_and_got(contacts, measured, kinds, processes)
    ratios = times.ratios(timed_rows)
    medians = full_grid.medians(rows_of_full_grids)
    return Report(
        {
            "promises": promises(asked_rows, ratios, medians),
            "asked": summary.by_error(asked_rows, "area", "kind"),
            "answers": summary.by_error(asked_rows, "all", "answer"),
            "bars": summary.bars_of_maps(asked_rows),
            "contacts": asked_rows,
            "ratios": ratios,
            "curves": times.curves(timed_rows),
            "times": timed_rows,
            "full": medians,
            "full-maps": rows_of_full_grids,
        }
    )


def _check(waves: Sequence[int], nodes: Sequence[int], of: Sequence[str]) -> None:
    """Raise InputError for an unknown study, a number of waves below 1, or too few nodes."""
    for name in of:
        if name not in STUDIES:
            raise InputError(f"--of {name}: give some of {', '.join(STUDIES)}")
    for number in waves:
        if number < 1:
            raise InputError(f"--waves {number}: give numbers from 1 on")
    for size in nodes:
        if size < FEWEST_NODES:
            raise InputError(f"--nodes {size}: give numbers from {FEWEST_NODES} on")
