"""`python -m bench peers`: other solvers on free or periodic patches, and bodies that yield."""

from collections.abc import Sequence
from pathlib import Path

from bench.contents import Absent, Content, contents_of
from bench.files import read_table
from bench.peers import periodic
from bench.peers.compare import LOAD_ERROR, MISPLACED_SHARE, compare
from bench.peers.loads import up_to_full_contact
from bench.peers.sample import samples
from bench.report import Report, remark
from bench.solvers.others import OTHERS, installed, missing
from bench.solvers.own import BEM, PAPERS
from bench.solvers.solver import REFERENCE_RTOL
from gen.runtime.errors import InputError

CONDITIONS = f"""\
Each at its loosest tolerance with the force, or the displacement where it is given the force,
within {LOAD_ERROR:g} and the nodes in contact within {100 * MISPLACED_SHARE:g} % (or one) of a
reference of residual {REFERENCE_RTOL:g}. Set-up, once a grid, is not in the times; ASPHER's nested
grids are set up in each solve."""


def peers(
    nodes: Sequence[int],
    deltas: Sequence[float],
    rounds: int,
    hardness: Sequence[float],
    boundary: str,
) -> Report:
    """Compare all solvers that are installed at equal accuracy.

    The arguments are those of the command: nodes a side, displacements [um], turns, and hardnesses
    over E*. With hardnesses, those solvers that know one are compared on bodies that yield, elastic
    ones beside them, and pressed by loads up to full contact.

    Raises
    ------
    InputError
        If a grid, a displacement, a hardness or a boundary cannot be used.
    """
    if boundary not in {"free", "periodic"}:
        raise InputError(f"boundary {boundary}: give free or periodic")
    if boundary == "periodic" and hardness:
        raise InputError("hardness with boundary periodic: no other solver knows both, give one")
    if boundary == "periodic":
        return periodic.report(periodic.compare(nodes or [128, 256], rounds))
    nodes = nodes or [129, 257]
    _check(nodes, deltas, hardness)
    for package, install in missing().items():
        remark(f"{package} is not installed and left out: {install}")
    solvers = [BEM, PAPERS, *installed()]
    if not hardness:
        return Report({"peers": compare(samples(nodes, deltas), solvers, rounds)}, text=CONDITIONS)
    plastic = [solver for solver in solvers if solver.plastic]
    rows = compare(samples(nodes, deltas, hardness), plastic, rounds)
    pressed = [row for size in nodes for row in up_to_full_contact(size)]
    return Report({"hardness": rows, "hardness-loads": pressed}, text=CONDITIONS, of="hardness")


def _check(nodes: Sequence[int], deltas: Sequence[float], hardnesses: Sequence[float]) -> None:
    for size in nodes:
        if size < 3 or (size - 1) & (size - 2):
            raise InputError(f"nodes {size}: give 2^k + 1, as 129, 257, 513")
    for name, values, wanted in (
        ("delta", deltas, "a displacement above 0 um"),
        ("hardness", hardnesses, "a share of E* above 0"),
    ):
        for value in values:
            if not 0 < value < float("inf"):
                raise InputError(f"{name} {value}: give {wanted}")


def contents(folder: Path) -> list[Content]:
    """List what a folder of this report holds, and the solvers that took no part."""
    shown = contents_of("peers", folder)
    solvers = {row["solver"] for row in read_table(folder / "peers.csv")[1]}
    there = {solver.package for solver in OTHERS if solver.name in solvers}
    absent = {solver.package: solver.install for solver in OTHERS if solver.package not in there}
    return [*shown, *(Absent(package, how) for package, how in absent.items())]
