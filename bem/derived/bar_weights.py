"""Weights of the parts of the error bars of a contact's answers, see `bem.derived.grid_error`."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Weights:
    """Weights of the parts of an answer's bar, which add in squares.

    Attributes
    ----------
    difference : float
        Weight of the difference between the answers on both grids [1].
    border : float
        Weight of the share of the border, and of the root of the elongation of the cells [1].
    scatter : float
        Weight of the scatter of the border [1].
    yielded : float
        Weight of the least scatter of the border times the share of the nodes in contact that has
        yielded: the border of yielded spots may be anywhere in its cells [1].
    outer : float
        Weight of the share of the outer nodes of a free patch [1].
    work : float
        Weight of the work of the border [1].
    open_scatter : float
        Weight of the scatter of the border as a share of the open nodes, times the mean gap [1].
    node : float
        Weight of a single node: part of the answer over the number of nodes in contact, or of
        open nodes for all answers but the area [1].
    summit : float
        Weight of the change of the answer by a higher summit [1].
    """

    difference: float
    border: float = 0.0
    scatter: float = 0.0
    yielded: float = 0.0
    outer: float = 0.0
    work: float = 0.0
    open_scatter: float = 0.0
    node: float = 0.0
    summit: float = 0.0


WEIGHTS = {
    "edgeless": {
        "area": Weights(
            difference=0.48, border=0.006, scatter=0.035, yielded=0.7, summit=1.5
        ),
        "delta": Weights(
            difference=0.2, work=0.06, yielded=0.09, open_scatter=0.048, summit=1.6
        ),
        "force": Weights(difference=0.36, scatter=0.0125, yielded=0.3, summit=2.2),
        "mean_gap": Weights(
            difference=0.25, work=0.035, yielded=0.2, open_scatter=0.044, summit=1.5
        ),
        "stiffness": Weights(
            difference=0.55, scatter=0.28, yielded=0.7, node=10.5, summit=1.9
        ),
    },
    "free": {
        "area": Weights(
            difference=1.15, border=0.008, yielded=0.1, outer=0.0013, summit=1.5
        ),
        "delta": Weights(difference=1.22, work=0.17, yielded=0.08, summit=1.6),
        "force": Weights(
            difference=0.95, scatter=0.01, yielded=0.03, outer=0.02, summit=2.2
        ),
        "mean_gap": Weights(
            difference=0.75, work=0.06, outer=0.065, yielded=0.04, node=1.2, summit=1.6
        ),
        "stiffness": Weights(
            difference=0.6, scatter=0.09, outer=0.075, yielded=0.15, summit=1.9
        ),
    },
    "creased": {
        "area": Weights(difference=1.8, border=0.03, yielded=0.2, node=0.5, summit=1.0),
        "delta": Weights(
            difference=1.3, border=0.0002, work=0.05, yielded=0.05, summit=0.8
        ),
        "force": Weights(difference=0.7, border=0.006, yielded=0.2, summit=0.6),
        "mean_gap": Weights(difference=1.3, work=0.2, yielded=0.2, summit=1.0),
        "stiffness": Weights(
            difference=0.85, border=0.022, yielded=0.4, node=4.0, summit=0.6
        ),
    },
}
"""Weights by the kind of surface and by the answer.

They are fitted on 2,000 contacts of 22 kinds of surface, and at creases on 400 of turned profiles,
ridges and machined maps, so that about 95 % of the errors of each answer are inside. Those of the
summit are of an earlier fit, on 3,300 contacts. `asperity bench grid-error` and
`asperity bench accuracy` test them on other surfaces.
"""
