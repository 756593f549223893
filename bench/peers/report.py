"""The comparison's files, and what is printed."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

from bench.peers.compare import PEERS, Row, compare, contenders
from bench.peers.peer import Peer
from bench.peers.picture import draw
from bench.peers.sample import samples
from bench.peers.table import tables
from bench.picture import new_figure, save
from bench.table import write_table
from gen.runtime.errors import InputError
from gen.runtime.output import check_folder

UNITS = {"sigma0": "um", "delta": "um"}
"""Units of the columns whose names do not say them."""

Announce = Callable[[str], None]


def write_report(
    folder: Path,
    nodes: Sequence[int],
    deltas: Sequence[float],
    rounds: int,
    announce: Announce = lambda line: None,
) -> list[Path]:
    """Compare at equal accuracy: `peers.csv` and, with matplotlib, `peers.png`.

    Parameters
    ----------
    folder : where to; made if there is none
    nodes : nodes a side of the grids
    deltas : displacements of the far field [um]
    rounds : turns in which each solver is timed
    announce : told what is missing, what is being solved, and the tables

    Returns
    -------
    The files

    Raises
    ------
    InputError
        If a grid or a displacement cannot be used, or the folder cannot be written to
    """
    _check(nodes, deltas)
    figure = _figure()
    for line in absent_lines(PEERS):
        announce(line)
    table, picture = folder / "peers.csv", folder / "peers.png"
    check_folder(folder, table.name, picture.name)
    rows = compare(samples(nodes, deltas), contenders(), rounds, announce)
    write_rows(table, rows)
    announce(tables(rows))
    if figure is None:
        announce("no picture: matplotlib is not installed (extra 'plot')")
        return [table]
    draw(figure, rows)
    return [table, save(figure, picture)]


def _figure() -> Any:
    """An empty figure, or None without matplotlib: the table can do without it."""
    with suppress(InputError):
        return new_figure()
    return None


def _check(nodes: Sequence[int], deltas: Sequence[float]) -> None:
    for size in nodes:
        if size < 3 or (size - 1) & (size - 2):
            raise InputError(f"nodes {size}: give 2^k + 1, as 129, 257, 513")
    for delta in deltas:
        if not 0 < delta < float("inf"):
            raise InputError(f"delta {delta}: give a displacement above 0 um")


def absent_lines(peers: Iterable[Peer]) -> list[str]:
    """One line for each package that is not installed, with how to get it."""
    missing = {peer.package: peer.install for peer in peers if not peer.installed}
    return [f"{package} is not installed and left out: {how}" for package, how in missing.items()]


def write_rows(path: Path, rows: Iterable[Row]) -> None:
    """One line a row; a number is written with all its digits, None as nothing."""
    names = [f"{f.name}_{UNITS[f.name]}" if f.name in UNITS else f.name for f in fields(Row)]
    write_table(path, names, map(astuple, rows))
