"""`python -m bench peers`: the comparison, and words on what to see in it."""

from collections.abc import Sequence
from pathlib import Path

from bench.page import content
from bench.peers import periodic
from bench.peers.compare import compare
from bench.peers.layout import HARDNESSES, LOADS, draw, loads_table, tables
from bench.peers.loads import up_to_full_contact
from bench.peers.sample import samples
from bench.remarks import remark
from bench.report import Report
from bench.solvers.others import OTHERS, installed, missing
from bench.solvers.own import BEM, PAPERS
from bench.table import read_table
from gen.runtime.errors import InputError


def report(
    nodes: Sequence[int],
    deltas: Sequence[float],
    rounds: int,
    hardnesses: Sequence[float] = (),
) -> Report:
    """Compare all solvers that are installed at equal accuracy.

    With hardnesses, those solvers that know one are compared on bodies that yield, elastic ones
    beside them, and pressed by loads up to full contact.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side of the grids.
    deltas : sequence of float
        Displacements of the far field [um].
    rounds : int
        Turns in which each solver is timed.
    hardnesses : sequence of float
        Over E* [1].

    Raises
    ------
    InputError
        If a grid, a displacement or a hardness cannot be used.
    """
    _check(nodes, deltas, hardnesses)
    for package, install in missing().items():
        remark(f"{package} is not installed and left out: {install}")
    solvers = [BEM, PAPERS, *installed()]
    if not hardnesses:
        rows = compare(samples(nodes, deltas), solvers, rounds)
        pictures = {"peers": draw(rows, LOADS)}
        return Report({"peers": rows}, pictures=pictures, text=tables(rows, LOADS))
    plastic = [solver for solver in solvers if solver.plastic]
    rows = compare(samples(nodes, deltas, hardnesses), plastic, rounds)
    pressed = [row for size in nodes for row in up_to_full_contact(size)]
    return Report(
        {"hardness": rows, "hardness-loads": pressed},
        pictures={"hardness": draw(rows, HARDNESSES)},
        text=tables(rows, HARDNESSES) + loads_table(pressed),
    )


def _check(nodes: Sequence[int], deltas: Sequence[float], hardnesses: Sequence[float]) -> None:
    for size in nodes:
        if size < 3 or (size - 1) & (size - 2):
            raise InputError(f"nodes {size}: give 2^k + 1, as 129, 257, 513")
    for delta in deltas:
        if not 0 < delta < float("inf"):
            raise InputError(f"delta {delta}: give a displacement above 0 um")
    for hardness in hardnesses:
        if not 0 < hardness < float("inf"):
            raise InputError(f"hardness {hardness}: give a share of E* above 0")


def contents(folder: Path) -> list[content.Content]:
    """List what a folder of this report holds, with what to see in it."""
    table = folder / "peers.csv"
    solvers = {row["solver"] for row in read_table(table)[1]}
    there = {solver.package for solver in OTHERS if solver.name in solvers}
    absent = {solver.package: solver.install for solver in OTHERS if solver.package not in there}
    return [
        content.Figure(
            folder / "peers.png",
            "Processor time of a solve against the displacement, each solver at its loosest"
            " tolerance with the force within 1e-6 and the contact set within 0.05 %; below, over"
            " ours (1 is as fast). The paper's algorithm, non-negative least squares with a dense"
            " matrix, has its best where few nodes touch; its time grows with their cube.",
            data=(table,),
        ),
        content.Table(
            table,
            "The same as numbers.",
            columns=(
                "nodes", "hurst", "delta_um", "contact_nodes", "solver", "tolerance", "seconds",
                "times_ours", "load_error", "misplaced_nodes", "remark",
            ),
        ),
        *(content.Absent(package, how) for package, how in absent.items()),
        *(yielding_contents(folder) if (folder / "hardness.csv").exists() else ()),
        *(periodic.contents(folder) if (folder / "periodic.csv").exists() else ()),
    ]  # fmt: skip


def yielding_contents(folder: Path) -> list[content.Content]:
    """List what a folder holds of the comparison on bodies that yield."""
    table = folder / "hardness.csv"
    command = "python -m bench peers --hardness 0.005,0.02,0.05,0.1,0.3 -o DIR"
    return [
        content.Figure(
            folder / "hardness.png",
            "The same on bodies that yield, over the hardness: ContactMechanics' plastic system"
            " beside ours, each at its loosest tolerance with the force within 1e-6 and the sets"
            " of nodes in contact and of yielded ones within 0.05 %.",
            command,
            (table,),
        ),
        content.Table(
            table,
            "The same as numbers, with applications of the influence matrix.",
            command,
            (
                "nodes", "delta_um", "hardness", "contact_nodes", "yielded_nodes", "solver",
                "tolerance", "seconds", "times_ours", "convolutions", "load_error",
                "misplaced_nodes", "remark",
            ),
        ),
        content.Table(
            folder / "hardness-loads.csv",
            "A given mean pressure [E*] up to nearly the hardness, where all nodes yield: whether"
            " each solver converges, in how many applications of the influence matrix, and the"
            " largest difference of their pressures over the hardness.",
            command,
        ),
    ]  # fmt: skip
