"""How contact area and mean pressure depend on the grid, with a hardness and without.

On a self-affine surface the elastic contact has no limit: with every halving of the spacing slopes
grow, the area falls and the pressure rises. A hardness bounds the pressure from some grid on.
The same surfaces are pressed by the same mean pressure on grids that hold each other's nodes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import bem
from bench import growth
from bench.growth import SIDE, surface
from bench.page.content import Absent, Content, Figure
from bench.picture import new_figure
from bench.style import STYLES

PRESSURE = 2e-3  # on the patch [E*]
HARDNESSES = (None, 0.1, 0.05, 0.02)  # E*


@dataclass(frozen=True)
class YieldingRow:
    """One grid, means over surfaces.

    Attributes
    ----------
    hardness : float or None
        Hardness, None for an elastic half-space [E*].
    nodes : int
        Nodes a side.
    area_percent : float
        Share of the nodes in contact [%].
    yielded_percent : float
        Share of the nodes whose pressure is the hardness [%].
    mean_pressure : float
        Force over the contact's area [E*].
    convolutions : float
        Applications of the influence matrix.
    """

    hardness: float | None
    nodes: int
    area_percent: float
    yielded_percent: float
    mean_pressure: float
    convolutions: float


def grids(
    nodes: Sequence[int], surfaces: int, remark: Callable[[str], None] = lambda _: None
) -> list[YieldingRow]:
    """Press the same surfaces with the same mean pressure on each grid.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side, each 2^k + 1.
    surfaces : int
        Number of surfaces, each of its own seed.
    remark : callable
        Told about every grid.
    """
    rows = []
    for hardness in HARDNESSES:
        for size in nodes:
            contacts = [
                bem.solve(surface(size, seed), SIDE, pressure=PRESSURE, hardness=hardness)
                for seed in range(surfaces)
            ]
            measured = [
                (
                    contact.area_percent,
                    contact.yielded_percent,
                    100 * PRESSURE / contact.area_percent,
                    contact.convolutions,
                )
                for contact in contacts
            ]
            rows.append(YieldingRow(hardness, size, *np.mean(measured, axis=0).tolist()))
            remark(f"{_label(hardness)}, {size} nodes: {rows[-1].area_percent:.3g} %")
    return rows


def picture(rows: Sequence[YieldingRow]) -> Any:
    """Draw area, mean pressure and convolutions over the nodes a side."""
    figure = new_figure(11, 3.6)
    panels = figure.subplots(1, 3)
    columns = {
        "area_percent": "contact area [% of the nodes]",
        "mean_pressure": "mean contact pressure [E*]",
        "convolutions": "applications of H",
    }
    for panel, (column, label) in zip(panels, columns.items(), strict=True):
        for hardness, style in zip(HARDNESSES, STYLES, strict=False):
            own = [row for row in rows if row.hardness == hardness]
            x, y = [row.nodes for row in own], [getattr(row, column) for row in own]
            panel.plot(x, y, label=_label(hardness), **style)
        sizes = sorted({row.nodes for row in rows})
        panel.set(xscale="log", xlabel="nodes a side", ylabel=label, ylim=(0, None))
        panel.set_xticks(sizes, [str(size) for size in sizes])
        panel.minorticks_off()
    panels[1].legend()
    return figure


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder of `python -m bench growth`."""
    drawn = folder / "yielding.png"
    if not drawn.exists():
        missing = Absent("Contact area and mean pressure", f"python -m bench growth -o {folder}")
        return [*growth.contents(folder), missing]
    return [
        *growth.contents(folder),
        Figure(
            drawn,
            f"The same surfaces under the same mean pressure of {PRESSURE:g} E* on finer and finer"
            " grids, elastic and with a hardness. Elastic areas fall with every halving of the"
            " spacing, as mean pressures rise with the slopes; where most of the contact yields,"
            " the area is the force over the hardness on every grid.",
            data=(folder / "yielding.csv",),
        ),
    ]


def _label(hardness: float | None) -> str:
    return "elastic" if hardness is None else f"H = {hardness:g} E*"
