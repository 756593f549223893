"""How far ours is from the paper's, in words, and why where that is known."""

import math

AREAS = (
    "the paper's areas end at {:g} %, probably where its simulations no longer finished: its"
    " program lets the far field give way, and near a limiting displacement the force grows"
    " without bound; ours holds it rigid, as the paper's text has it"
)
BANDWIDTH = (
    "the paper does not define its parameter; ours is Nayak's m0 m4 / m2^2, which is several times"
    " larger"
)
EXTREMES = "ends of a random sample; sigma0 is not in the paper, ours was calibrated"
SPREAD = (
    "nMSE carries the area's unit: at equal R2 it grows with the areas' variance over their mean,"
    " {:.2g} % here and {:.2g} % in the paper"
)
TWO_SPREADS = "the paper's nMSE and R2 of this model do not belong to the same test areas"
UNEXPLAINED = "not explained"
MACHINE = "another machine; ours on one thread, the fit alone"
SEARCH = (
    "another machine, one thread; the search is exact, but leaves out fits that cannot differ:"
    " {} instead of {}"
)
SOLVER = "The solver makes the difference: active sets, preconditioned conjugate gradients, FFT"
FINE = (
    "our curvatures grow {:.2g}-fold where the spacing halves, in {:.0f} % of the rows to values"
    " that no training row has; the paper's do not depend on the spacing, or its rows were made"
    " otherwise"
)
KERNEL = (
    "The paper's areas lie below Hertz's, further on the coarser grid: so do ours with"
    " concentrated forces, a kernel that MIRCO has and under which a cell yields too little to its"
    " own pressure, but not with our default"
)


DIGITS = 4
"""Significant digits of numbers in tables that people read."""


def ratio(ours: float, theirs: float) -> str:
    """Write our number over the paper's."""
    if not theirs or math.isnan(ours) or math.isnan(theirs):
        return ""
    times = ours / theirs
    return f"x {times:.3g}" if times >= 0.1 else f"1/{1 / times:,.0f}"
