"""`python -m bench solver`: the table, the picture, and how and where they were made."""

from dataclasses import asdict
from pathlib import Path

from bench.circumstances import circumstances
from bench.page.content import Content, Figure
from bench.remarks import remark
from bench.report import Report
from bench.work_precision.measurement import AREA_GATE, FORCE_GATE, PRESSURE_GATE
from bench.work_precision.picture import draw
from bench.work_precision.studies import Extent, sweep


def report(extent: Extent) -> Report:
    """Measure all studies."""
    rows = list(sweep(extent))
    points = [row for row in rows if "reason" not in row]
    left_out = [row for row in rows if "reason" in row]
    for row in left_out:
        remark(f"{row['study']}: left out {row['solver']}: {row['reason']}")
    record = {
        **circumstances(),
        "extent": asdict(extent),
        "gates": {"force": FORCE_GATE, "pressure": PRESSURE_GATE, "contact_nodes": AREA_GATE},
        "left_out": left_out,
    }
    return Report({"solver": points}, records={"solver": record}, pictures={"solver": draw(points)})


def contents(folder: Path) -> list[Content]:
    """List what a folder of this report holds, with what to see in it."""
    return [
        Figure(
            folder / "solver.png",
            "Error of force, area and pressure against wall time and against convolutions: for the"
            " tolerance, the grid, both kernels, both precisions, and other solvers where they are"
            " installed. Down and to the left is better; a flat curve says that accuracy is cheap."
            " Unlike the force, the area of a self-affine surface does not converge as the grid is"
            " refined.",
            data=(folder / "solver.csv",),
        )
    ]
