"""Commands on the contact solver: exactness, speed, stiff cases."""

from bench.commands.options import Folder, FolderIfAny, numbers, option, require_place, tell
from gen.runtime.errors import InputError

GRIDS = option("129,257,513,1025", "Nodes a side of the grids, each 2^k + 1.", metavar="N,...")
SURFACES = option(3, "Surfaces, each of its own seed.", min=1)


def solver(
    output: Folder,
    quick: bool = option(False, "Small grids: a look in seconds.", "--quick"),
) -> None:
    """Measure the solver's error against its cost.

    Force, area and pressure over wall time and over applications of the influence matrix, for the
    tolerance, the grid, both kernels and other solvers where they are installed:
    DIR/solver.csv, DIR/solver.png, and DIR/solver.json for where and with what.
    """
    from bench.work_precision.report import report
    from bench.work_precision.studies import FULL, QUICK

    require_place(output, "solver.csv", "solver.json", "solver.png")
    tell(output, report(QUICK if quick else FULL))


def peers(
    output: Folder,
    nodes: str = option("", "Nodes a side, each 2^k + 1, or 2^k if periodic.", metavar="N,..."),
    deltas: str = option("5,25,45", "Displacements of the far field.", metavar="UM,..."),
    rounds: int = option(
        4, "Turns; medians count. On periodic patches 3 at most from 512 nodes on.", min=1
    ),
    hardness: str = option(
        "", "Over E*: bodies that yield, DIR/hardness.csv.", metavar="RATIO,..."
    ),
    boundary: str = option("free", "free, or periodic: DIR/periodic.csv.", metavar="NAME"),
) -> None:
    """Compare with other solvers, and with the paper's algorithm, at equal accuracy.

    ContactMechanics, Tamaas and ASPHER where they are installed, on surfaces with H = 0.65 and
    sigma0 = 20 um: each at the loosest tolerance that gives force and contact well enough, timed
    in turn. Minutes at 129 and 257 nodes, much longer beyond. Prints tables, writes
    DIR/peers.csv and DIR/peers.png. With --hardness, bodies that yield: the solvers that know a
    hardness, DIR/hardness.csv and .png, and loads up to full contact, DIR/hardness-loads.csv. With
    --boundary periodic, five surfaces under five loads: DIR/periodic.csv and .png.
    """
    from bench.peers import periodic
    from bench.peers.report import report

    if boundary not in {"free", "periodic"}:
        raise InputError(f"boundary {boundary}: give free or periodic")
    if boundary == "periodic" and hardness:
        raise InputError("hardness with boundary periodic: no other solver knows both, give one")
    sizes = numbers("nodes", nodes or ("129,257" if boundary == "free" else "128,256"), int)
    if boundary == "periodic":
        names = ["periodic.csv", "periodic-agreement.csv", "periodic.png"]
        require_place(output, *names)
        return tell(output, periodic.report(periodic.compare(sizes, rounds)))
    loads = numbers("deltas", deltas, float)
    ratios = numbers("hardness", hardness, float) if hardness else []
    names = ["hardness.csv", "hardness-loads.csv", "hardness.png"]
    require_place(output, *(names if ratios else ["peers.csv", "peers.png"]))
    return tell(output, report(sizes, loads, rounds, ratios))


def growth(
    output: Folder,
    nodes: str = GRIDS,
    surfaces: int = SURFACES,
) -> None:
    """Measure how convolutions, time and memory of a solve grow with the grid.

    At 1, 10 and 50 % of the nodes in contact; then how area and mean pressure of the same surfaces
    depend on the grid under one load, with a hardness and without. Some minutes. Prints a table,
    writes DIR/growth.csv and .png, and DIR/yielding.csv and .png.
    """
    from bench.growth import cost, pressures, report

    require_place(output, "growth.csv", "growth.png", "yielding.csv", "yielding.png")
    sizes = numbers("nodes", nodes, int)
    tell(output, report(cost(sizes, surfaces), pressures(sizes, surfaces)))


def threads(
    output: Folder,
    nodes: str = option("1025,2049", "Nodes a side of the grids, each 2^k + 1.", metavar="N,..."),
    percents: str = option("1,10,50", "Shares of the nodes in contact.", metavar="PERCENT,..."),
    number: int = option(2, "Threads beside a single one.", "--threads", metavar="N", min=2),
    rounds: int = option(3, "Turns; medians count; one turn from 4,097 nodes on.", min=1),
) -> None:
    """Measure how much faster one large solve is on several threads.

    Beside it what as many copies of the transforms alone reach, and estimates for more threads by
    Amdahl's law, from the part of the solve that threads share. On a quiet machine a minute at
    1,025 nodes, some ten minutes at 4,097. Prints a table, writes DIR/threads.csv and .png.
    """
    from bench.threads import measure, report

    require_place(output, "threads.csv", "threads.png")
    sizes, shares = numbers("nodes", nodes, int), numbers("percents", percents, float)
    tell(output, report(measure(sizes, shares, number, rounds)))


def hertz(output: Folder) -> None:
    """Press a paraboloid and compare with Hertz.

    Force and area against the displacement, for the closed form and for both kernels on 128 and on
    256 nodes a side, as in section 2.4 of the paper: DIR/hertz.csv and DIR/hertz.png.
    """
    from bench.hertz import compare, report

    require_place(output, "hertz.csv", "hertz.png")
    tell(output, report(compare()))


def theory(
    output: Folder,
    nodes: int = option(512, "Nodes a side.", min=128),
    surfaces: int = option(3, "Surfaces of each spectrum.", min=1),
) -> None:
    """Compare contacts of random surfaces without edges with the theories of such contacts.

    Area, mean gap and stiffness over the mean pressure, for five power spectra, beside Persson's
    theory and that of Bush, Gibson and Thomas. Minutes. Writes DIR/theory.csv, DIR/area.png and
    DIR/gap.png.
    """
    from bench.theory import compare, report

    require_place(output, "theory.csv", "area.png", "gap.png")
    tell(output, report(compare(nodes, surfaces)))


def calculix(output: Folder) -> int:
    """Press two blocks with laws between them in CalculiX, and compare with the laws' tables.

    Closure, pressure and jump of the temperature: DIR/calculix.csv and DIR/calculix.png. Needs
    `ccx`. Exit code 0 if all are within 1 %, 1 otherwise.
    """
    from bench.calculix import measure, report

    require_place(output, "calculix.csv", "calculix.png")
    rows = measure(output)
    tell(output, report(rows))
    return 0 if all(row["verdict"] == "passed" for row in rows) else 1


def stability(
    output: FolderIfAny = None,
    full: bool = option(False, "The slow cases too.", "--full"),
    of: list[str] | None = option(
        None,
        "surfaces, solver, loads, hardness, edgeless or models alone; may be repeated.",
        metavar="TABLE",
    ),
) -> int:
    """Solve stiff and extreme cases, and check every answer independently.

    Of surfaces (generators and statistics), of the solver, of random loads, of random contacts that
    yield and of the nine models with their features: prints a table each and writes
    DIR/surfaces.csv, stability.csv, loads.csv, hardness.csv and models.csv if asked to. Exit code 0
    if all cases passed, 1 otherwise.
    """
    from bench.stability.tables import report

    return 0 if report(output, full=full, of=of or ()) else 1
