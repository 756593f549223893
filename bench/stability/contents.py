"""What the page shows of the tables in a folder: short columns, red where a verdict is bad."""

from pathlib import Path

from bench.page.content import Absent, Content, Table

FILES = {
    "surfaces": "surfaces.csv",
    "solver": "stability.csv",
    "loads": "loads.csv",
    "models": "models.csv",
}
"""Of the tables, in the order of the page, which is that of the work."""

CAPTIONS = {
    "surfaces": (
        "Generators and the 22 statistics: Hurst exponents as near to 0 and 1 as numbers go,"
        " amplitudes from 0 to 1e300 um, offsets under which variance cancels, ties, plateaus, one"
        " peak and none, every memory layout. Judged by the same definitions in whole numbers and"
        " fractions, or by an exact scaling or symmetry; what an offset has rounded away has to be"
        " said."
    ),
    "solver": (
        "The contact solver: each answer is proved from its pressure alone, with influence"
        " coefficients and a convolution of the check's own, and many again by a dense solve, a"
        " closed form or a symmetry. Iterations stand beside those of an ordinary contact."
    ),
    "loads": (
        "Random forces and mean pressures at every tolerance from 1e-2 to 1e-13: an answer to each,"
        " whose residual a convolution of the check's own confirms and whose force is the one given"
        " to 12 digits. Solves of more than 20 s count as endless."
    ),
    "models": (
        "The nine models with their libraries' settings and with tuned ones, their features, splits"
        " and scores: constant and collinear inputs, outliers, extreme units, nearly singular"
        " kernels, rows far outside the training. Predictions have to be finite, right where an"
        " exact solution or a change of units says what is right, and flagged where nothing is"
        " known."
    ),
}

CHECKED = ("family", "case", "input", "what_came_out", "check", "error", "allowed", "verdict")
SOLVED = (
    "family",
    "case",
    "input",
    "message",
    "area_percent",
    "residual",
    "iterations",
    "ordinary_iterations",
    "reason",
    "worst",
    "verdict",
)
COLUMNS = {"surfaces": CHECKED, "solver": SOLVED, "loads": CHECKED, "models": CHECKED}


def contents(folder: Path) -> list[Content]:
    """The tables of a folder that `python -m bench stability -o` has written."""
    return [_shown(folder, name) for name in FILES]


def _shown(folder: Path, name: str) -> Content:
    data = folder / FILES[name]
    if not data.exists():
        command = f"python -m bench stability --of {name} -o {folder}"
        return Absent(f"Stiff and extreme cases of the {name}", command)
    return Table(data, CAPTIONS[name], columns=COLUMNS[name], verdict="verdict")
