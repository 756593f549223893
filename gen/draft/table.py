"""Print the survey of the files of maps."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from gen.draft.survey import MapSurvey, remarks
from gen.runtime.terminal import print_table

WIDTH = 132
"""Width of the table without a terminal [characters]."""

TITLES = (
    *("map", "nodes", "spacing um", "unit", "holes %", "spikes", "tilt", "rms height um"),
    *("rms slope", "use"),
)


def print_looks(looks: Sequence[MapSurvey]) -> None:
    """Print a line for each file: its content, and whether it is used or why not."""
    table = Table(box=None, pad_edge=False)
    for title in TITLES:
        left = title in {"map", "unit", "use"}
        table.add_column(title, justify="left" if left else "right", overflow="fold")
    for look in looks:
        table.add_row(*_cells(look))
    print_table(table, WIDTH)


def _cells(look: MapSurvey) -> list[str]:
    """Write the known facts of a file, and a dash for each unknown one."""
    use = f"no: {look.fault}" if look.fault else "; ".join(["yes", *remarks(look)])
    if not look.shape[0]:
        return [look.path.name, *["-"] * (len(TITLES) - 2), use]
    dx, dy = (f"{step:.4g}" for step in look.spacing)
    texture = look.texture
    return [
        look.path.name,
        f"{look.shape[0]} x {look.shape[1]}",
        dx if dx == dy else f"{dx} x {dy}",
        look.unit or "um?",
        f"{100 * look.holes:.2g}",
        "-" if look.spikes is None else str(look.spikes.number),
        "-" if math.isnan(look.tilt[0]) else f"{max(map(abs, look.tilt)):.2g}",
        "-" if texture is None else f"{texture.rms_height:.3g}",
        "-" if texture is None else f"{texture.rms_slope:.3g}",
        use,
    ]
