"""The picture of a growth: learning curve, prediction over truth, coverage of the intervals."""

from typing import Any

import numpy as np

from gen.runtime.figure import draw_parity, log_axis, parity_axes
from learn.grow.appraisal import LEVEL, Appraisal
from learn.grow.curve import Curve

WIDTH, HEIGHT = 13.0, 4.3
"""Size of the picture [inches]."""

QUARTERS = 4
"""Parts of the test rows, by their solved value, whose coverage is drawn."""

COLOUR, MARK = "tab:blue", "tab:red"


def draw(figure: Any, found: Appraisal, curve: Curve | None) -> None:
    """Draw a surrogate and its learning curve into an empty figure.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Figure of `WIDTH` x `HEIGHT`.
    found : Appraisal
        The surrogate, of which the worst target is drawn.
    curve : Curve or None
        Its learning curve, if there are enough rows for one.
    """
    learning, parity, coverage = figure.subplots(1, 3)
    _draw_learning(learning, found, curve)
    _draw_parity(parity, found)
    _draw_coverage(coverage, found)


def _quantity(found: Appraisal) -> str:
    """Return the worst target with its unit."""
    unit = found.surrogate.learnt[found.worst].unit
    return found.worst if unit == "1" else f"{found.worst} [{unit}]"


def _draw_learning(axis: Any, found: Appraisal, curve: Curve | None) -> None:
    """Draw errors over rows, the curve with its band, and the mark."""
    judged = found.judged[found.worst].accuracy
    if curve is not None:
        spread = curve.nmae - curve.lowest, curve.highest - curve.nmae
        axis.errorbar(curve.rows, curve.nmae, spread, fmt="o", color="0.4", ms=4, label="parts")
        rows = np.geomspace(curve.rows[0], 8 * curve.rows[-1], 100)
        fit, low, high = curve.at(rows)
        axis.plot(rows, fit, color=COLOUR, label="a + b n$^{-c}$, 80 % of its draws")
        axis.fill_between(rows, low, high, color=COLOUR, alpha=0.2, lw=0)
    bound = found.bound(found.worst) - judged.nmae
    axis.errorbar(
        [found.rows],
        [judged.nmae],
        [[0.0], [bound if np.isfinite(bound) else 0.0]],
        fmt="s",
        color="black",
        capsize=4,
        label="all rows, with their bound",
    )
    axis.axhline(found.mark, color=MARK, ls="--", label=f"asked for, {found.mark:g} %")
    axis.set(xlabel="rows of the database", ylabel="nMAE [%]")
    axis.set_title(f"Learning curve, {found.worst}")
    log_axis(axis.xaxis)
    log_axis(axis.yaxis)
    axis.grid(visible=True, which="major", color="0.9")
    axis.legend(fontsize=8)


def _draw_parity(axis: Any, found: Appraisal) -> None:
    """Draw predictions with their intervals over the truth."""
    judged = found.judged[found.worst]
    inside = (judged.low <= judged.truth) & (judged.truth <= judged.high)
    parity_axes(axis, judged.truth)
    for chosen, colour, name in (
        (inside, COLOUR, "inside its interval"),
        (~inside, MARK, "outside"),
    ):
        ends = np.clip([judged.low[chosen], judged.high[chosen]], *axis.get_ylim())
        axis.vlines(judged.truth[chosen], ends[0], ends[1], color=colour, alpha=0.25, lw=1)
        label, look = f"{name} ({int(chosen.sum())})", {"marker": ".", "ms": 4, "ls": "none"}
        draw_parity(
            axis, judged.truth[chosen], judged.prediction[chosen], label=label, color=colour, **look
        )
    axis.set(xlabel=f"solved {_quantity(found)}", ylabel="predicted")
    axis.set_title(f"{judged.truth.size} rows held out for tests")
    axis.legend(fontsize=8, loc="upper left")


def _draw_coverage(axis: Any, found: Appraisal) -> None:
    """Draw the share of the rows inside their interval, in all and by quarters of the truth."""
    judged = found.judged[found.worst]
    inside = (judged.low <= judged.truth) & (judged.truth <= judged.high)
    order = np.argsort(judged.truth, kind="stable")
    parts = [order, *np.array_split(order, min(QUARTERS, max(1, order.size // 10)))]
    ends = ((judged.truth[part].min(), judged.truth[part].max()) for part in parts[1:])
    names = ["all", *(f"{low:.3g}\nto {high:.3g}" for low, high in ends)]
    shares = np.array([100 * inside[part].mean() for part in parts])
    sizes = np.array([part.size for part in parts])
    deviations = 100 * np.sqrt(LEVEL * (1 - LEVEL) / sizes)
    places = np.arange(len(parts))
    axis.errorbar(places, shares, deviations, fmt="o", color=COLOUR, capsize=4)
    axis.axhline(100 * LEVEL, color=MARK, ls="--", label=f"wanted, {LEVEL:.0%}")
    axis.set_xticks(places, names, fontsize=8)
    axis.set(ylabel="rows inside their interval [%]", xlabel=f"by solved {_quantity(found)}")
    axis.set_ylim(min(70.0, float(np.min(shares - deviations)) - 3), 102)
    axis.set_title("Coverage, with standard errors")
    axis.grid(visible=True, axis="y", color="0.9")
    axis.legend(fontsize=8, loc="lower right")
