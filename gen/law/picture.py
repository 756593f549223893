"""Draw a contact law: closure, area and conductance over pressure, in linear and log axes."""

from pathlib import Path
from typing import Any

import numpy as np

from gen.law.contact_law import Law
from gen.law.curves import CONDUCTANCE, Curve
from gen.law.points import STIFFNESS
from gen.runtime.figure import save

LABELS = {
    "closure_um": "closure [µm]",
    "area_percent": "contact area [%]",
    CONDUCTANCE: "conductance [W/(mm² K)]",
    STIFFNESS: "stiffness [MPa/µm]",
}


def draw(figure: Any, law: Law, picture: Path) -> None:
    """Draw a law with its bands.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty figure.
    law : Law
        The law, whose table against pressure is drawn where it is inside a surrogate's training.
    picture : Path
        Picture to write.
    """
    curves = law.over_pressure.chosen(~law.over_pressure.flagged)
    names = ["closure_um", "area_percent"]
    names += [name for name in (CONDUCTANCE, STIFFNESS) if name in curves.curves][:1]
    figure.suptitle(
        f"{law.title}\n{law.bodies.text}; band: {law.band}", fontsize=11, parse_math=False
    )
    axes = figure.subplots(2, len(names))
    for column, name in enumerate(names):
        for row, scale in enumerate(("linear", "log")):
            _draw_curve(axes[row, column], curves.at, curves.curves[name], scale)
            axes[row, column].set(xlabel="nominal pressure [MPa]", ylabel=LABELS[name])
    save(figure, picture)


def _draw_curve(axis: Any, at: Any, curve: Curve, scale: str) -> None:
    """Draw one curve and its band in axes of one scale."""
    finite = np.isfinite(curve.value)
    drawn = finite & (at > 0) & (curve.value > 0) if scale == "log" else finite
    axis.set(xscale=scale, yscale=scale)
    axis.plot(at[drawn], curve.value[drawn], ".-", color="tab:blue")
    band = drawn & curve.banded
    band &= (curve.low > 0) | (scale == "linear")
    if band.any():
        axis.fill_between(at[band], curve.low[band], curve.high[band], alpha=0.25, lw=0)
    axis.grid(alpha=0.3)
    if scale == "linear":
        axis.set(xlim=(0, None), ylim=(0, None))
