"""The choices that the paper leaves open, what we take, and what else it may have been."""

from dataclasses import dataclass

OURS = "ours"
"""The paper preset as it is."""


@dataclass(frozen=True)
class Variant:
    """The paper preset with another choice: the scene says in TOML what differs.

    Areas above `area_max` are left out [%]; None keeps them all.
    """

    choice: str
    ours: str
    other: str
    name: str
    scene: str = ""
    area_max: float | None = 16.56


CONCENTRATED = 'kernel = "concentrated-force"'
COMPLIANT = 'far_field = "compliant"'
SIDE_N = 'spacing = "side/n"'

VARIANTS = (
    Variant("none: the preset itself", "", "", OURS),
    Variant("seed", "2025", "another: what chance does", "seed", "seed = 7\n"),
    Variant(
        "influence coefficients",
        "uniform pressure on cells",
        "concentrated forces",
        "concentrated",
        f"[contact]\n{CONCENTRATED}\n",
    ),
    Variant("far field", "rigid", "gives way (MIRCO)", "compliant", f"[contact]\n{COMPLIANT}\n"),
    Variant("spacing", "L/(n-1)", "L/n (MIRCO)", "side-n", f"[contact]\n{SIDE_N}\n"),
    Variant(
        "all of MIRCO's mechanics",
        "none of them",
        "concentrated forces, far field gives way, L/n",
        "mirco",
        f"[contact]\n{CONCENTRATED}\n{COMPLIANT}\n{SIDE_N}\n",
    ),
    Variant(
        "generator",
        "diamond-square (MIRCO)",
        "midpoint, as the text has it",
        "midpoint",
        '[surface]\ngenerator = "midpoint"\n',
    ),
    Variant("sigma0", "10 to 15 um", "5 to 10 um", "smooth", "[surface]\nsigma0 = [5.0, 10.0]\n"),
    Variant("sigma0", "10 to 15 um", "15 to 20 um", "rough", "[surface]\nsigma0 = [15.0, 20.0]\n"),
    Variant("sigma0", "10 to 15 um", "5 to 20 um", "wide", "[surface]\nsigma0 = [5.0, 20.0]\n"),
    Variant(
        "shares of Delta",
        "75 % up to 25 um",
        "even from 5 to 45 um",
        "even-delta",
        "[delta]\npieces = [{ share = 1.0, range = [5.0, 45.0] }]\n",
    ),
    Variant(
        "simulations cut off",
        "areas above 16.56 %",
        "none: all areas are kept",
        OURS,
        area_max=None,
    ),
)
"""One choice at a time, against the first."""
