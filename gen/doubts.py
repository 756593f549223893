"""Reasons to distrust a contact problem, in one wording for all commands.

A problem is doubted for what a slip of a unit or a missing modulus does to it: a material that no
solid has, surfaces that are too steep for the theory, loads that press every node into contact or
no more than one, and pressures that real bodies would not bear. A single problem is doubted for
any of its contacts. Of a database, where single rows may be extreme on purpose, the same is said
if it holds for most rows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gen.arrays import Heights, Values
from gen.material import Bodies

HARDNESSES = (1e-4, 0.2)
"""Hardness over E* of solids: soft metals have some 1e-3, glasses and polymers up to 0.1."""

STIFFEST = 2e6
"""E* above which there is no solid; diamond has 1.2e6 [MPa]."""

SLIPS = (
    (1e-3, "is the modulus in GPa"),
    (1e3, "is the hardness in GPa"),
    (1e-6, "is the hardness in Pa"),
    (1e6, "is the modulus in Pa"),
)
"""Likely slips of a unit: the factor that corrects hardness over E*, and the question to ask."""

# E* over the pressure from which a warning is due: the hardness of steel is 2 GPa at 230 GPa, and
# only glasses, ceramics and rubber bear more than a hundredth of E*
YIELDING = 100

# rms slope above which half-space theory, made for small slopes, is in doubt; the paper's rough
# surfaces have 0.10 to 0.44
STEEP = 0.3
# rms slope above which a row of a database is too steep; wide populations exceed STEEP on purpose
STEEP_ROW = 1.0

MOST = 0.5  # share of a database's rows above which a doubt about them is told

OPTIONS = "--young or --e-star"  # what gives the modulus of a command
KEYS = "modulus in [contact]"  # and of a scene

CHECK_LOAD = "check the load and the unit of the heights"


@dataclass(frozen=True)
class Pressed:
    """What doubts about one solved contact need."""

    delta: float  # far-field displacement [um]
    largest_pressure: float  # [MPa]
    contact_nodes: int


@dataclass(frozen=True, eq=False)
class SolvedRows:
    """What doubts about solved rows of a database need: arrays of shape (rows,)."""

    delta: Values  # far-field displacement [um]
    span: Values  # difference of the highest and the lowest node [um]
    slope: Values  # rms slope between neighbouring nodes [1]; NaN where it is not known
    contact_nodes: Values
    pressure: Values  # nominal pressure [MPa]


@dataclass(frozen=True)
class Tally:
    """Counts and extremes of the rows of a database, which add up over its parts."""

    rows: int = 0
    full: int = 0  # rows in which every node touches
    full_from: tuple[float, float] = (
        math.inf,
        math.nan,
    )  # least Delta of these, and its span [um]
    single: int = 0  # rows in which one node touches, or none
    single_to: tuple[float, float] = (
        -math.inf,
        math.nan,
    )  # largest Delta of these, and its span
    steep: int = 0  # rows whose rms slope is above STEEP_ROW
    steepest: float = 0.0  # largest rms slope
    pressure: float = 0.0  # largest nominal pressure [MPa]

    @classmethod
    def of(cls, rows: SolvedRows, nodes: int) -> Tally:
        """Count solved rows.

        Parameters
        ----------
        rows : SolvedRows
            Rows whose contact is solved.
        nodes : int
            Number of nodes of the grid.

        Returns
        -------
        Tally
            Counts and extremes of these rows.
        """
        if not rows.delta.size:
            return cls()
        full = np.flatnonzero(rows.contact_nodes == nodes)
        single = np.flatnonzero(rows.contact_nodes <= 1)
        steep = rows.slope > STEEP_ROW  # false where the slope is not known
        pairs = list(zip(rows.delta.tolist(), rows.span.tolist(), strict=True))
        return cls(
            rows=rows.delta.size,
            full=full.size,
            full_from=min((pairs[row] for row in full), default=cls.full_from),
            single=single.size,
            single_to=max((pairs[row] for row in single), default=cls.single_to),
            steep=int(np.count_nonzero(steep)),
            steepest=float(rows.slope.max(where=steep, initial=0.0)),
            pressure=float(rows.pressure.max()),
        )

    def __add__(self, other: Tally) -> Tally:
        """Return the tally of the rows of both."""
        return Tally(
            rows=self.rows + other.rows,
            full=self.full + other.full,
            full_from=min(self.full_from, other.full_from),
            single=self.single + other.single,
            single_to=max(self.single_to, other.single_to),
            steep=self.steep + other.steep,
            steepest=max(self.steepest, other.steepest),
            pressure=max(self.pressure, other.pressure),
        )


def material_doubts(bodies: Bodies) -> list[str]:
    """Doubt numbers that no solid has, and ask for the likely slip of a unit.

    Parameters
    ----------
    bodies : Bodies
        E* and hardness [MPa].

    Returns
    -------
    list of str
        One line, or none.
    """
    low, high = HARDNESSES
    ratio = low if bodies.hardness is None else bodies.hardness / bodies.e_star
    if not low <= ratio <= high:
        slips = [words for factor, words in SLIPS if low <= ratio * factor <= high]
        slip = (
            [*slips, "are the units right"][0]
            if bodies.known
            else "is the modulus left out"
        )
        numbers = f"hardness over E* is {ratio:.3g}, solids have {low:g} to {high:g}"
        units = f"Both count in MPa, and E* is {bodies.e_star:.4g} MPa (steel: 2.3e5)"
        return [f"{numbers}: {slip}? {units}"]
    if bodies.e_star > STIFFEST:
        numbers = f"E* is {bodies.e_star:.3g} MPa, diamond has 1.2e6"
        return [f"{numbers}: is the modulus in Pa? It counts in MPa (steel: 210e3)"]
    return []


def modulus_in_words(bodies: Bodies, given_by: str = OPTIONS) -> str:
    """Say what E* is, and what gives it if nothing does.

    Parameters
    ----------
    bodies : Bodies
        E* [MPa], and whether the user gave it.
    given_by : str
        Options or keys that give the modulus.

    Returns
    -------
    str
        Part of a sentence.
    """
    modulus = f"E* is {bodies.e_star:.4g} MPa"
    if bodies.known or bodies.e_star != 1.0:
        return modulus
    return f"{modulus}, the default without a modulus ({given_by})"


def steep_slopes(slope: float, apart: float, where: str = "") -> str:
    """Doubt the theory of the half-space on steep surfaces.

    Parameters
    ----------
    slope : float
        Rms slope between neighbouring nodes [1].
    apart : float
        Distance of these nodes [um].
    where : str
        Part of the sentence that says for which rows this holds.

    Returns
    -------
    str
        One line.
    """
    return (
        f"rms slope {slope:.3g} between nodes {apart:.3g} um apart{where}: the theory of the"
        f" half-space takes slopes for small (below {STEEP:g}); check the unit of heights and"
        " lengths"
    )


def _full_contact(delta: float, span: float, advice: str, where: str = "") -> str:
    """Doubt loads under which every node touches, from a displacement [um] on."""
    return (
        f"from Delta = {delta:.4g} um on every node touches{where}, the heights span"
        f" {span:.4g} um: {advice}"
    )


def contact_doubts(
    heights: Heights, bodies: Bodies, load: str, solved: Sequence[Pressed]
) -> list[str]:
    """Doubt contacts of one surface: full contact, and pressures at which real bodies yield.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    bodies : Bodies
        E* and hardness [MPa].
    load : {"delta", "force", "pressure"}
        Quantity that the loads were given in.
    solved : sequence of Pressed
        The contacts, one or more.

    Returns
    -------
    list of str
        One line for each doubt.
    """
    doubts: list[str] = []
    largest = max(contact.largest_pressure for contact in solved)
    limit = bodies.e_star / YIELDING
    # without a material, a force or a pressure scales with an E* that nobody gave
    unscaled = load != "delta" and not bodies.known
    full = [contact.delta for contact in solved if contact.contact_nodes == heights.size]
    beyond = [contact.delta for contact in solved if contact.largest_pressure > limit]
    if full:
        advice = modulus_in_words(bodies) if unscaled else CHECK_LOAD
        doubts.append(_full_contact(min(full), float(np.ptp(heights)), advice))
    elif largest > bodies.e_star and unscaled:
        doubts.append(
            f"the largest pressure is {largest:.4g} MPa: {modulus_in_words(bodies)}"
        )
    if beyond and bodies.known and bodies.hardness is None:
        start = f"from Delta = {min(beyond):.4g} um on, " if len(solved) > 1 else ""
        units = (
            ", and check E*: moduli count in MPa (210e3)"
            if largest > bodies.e_star
            else ""
        )
        doubts.append(
            f"{start}the largest pressure ({largest:.4g} MPa) is above E*/{YIELDING:g} ="
            f" {limit:.4g} MPa: real metals and polymers would have yielded, and their contact area"
            f" is larger than this elastic one; give --hardness{units}"
        )
    return doubts


def rows_doubts(
    tally: Tally, bodies: Bodies, load: str, apart: float, noun: str = "rows"
) -> list[str]:
    """Doubt a database by its rows, or by rows that were tried before it is made.

    One slip has one line: what follows from steep surfaces is not told beside them.

    Parameters
    ----------
    tally : Tally
        Counts and extremes of the rows.
    bodies : Bodies
        E* [MPa], and whether the scene gives it.
    load : str
        Quantity that the scene gives its loads in.
    apart : float
        Distance of neighbouring nodes [um].
    noun : str
        Plural of a row, as messages call these.

    Returns
    -------
    list of str
        One line for each doubt.
    """
    doubts: list[str] = []
    of_all = f"of {tally.rows} {noun}"
    many = MOST * tally.rows
    in_units = load in {"pressure", "force"}  # which E* scales; other loads follow it
    modulus = modulus_in_words(bodies, KEYS)
    advice = CHECK_LOAD
    if in_units:
        advice = f"{modulus}; {CHECK_LOAD}" if bodies.known else modulus
    if tally.steep > many:  # then full and light contacts follow from the slopes
        where = f", above {STEEP_ROW:g} in {tally.steep} {of_all}"
        doubts.append(steep_slopes(tally.steepest, apart, where))
    elif tally.full > many:
        where = f" in {tally.full} {of_all}"
        return [_full_contact(*tally.full_from, advice, where)]
    elif tally.single > many:
        delta, span = tally.single_to
        doubts.append(
            f"up to Delta = {delta:.4g} um one node touches at most in {tally.single} {of_all},"
            f" the heights span {span:.4g} um: {advice}"
        )
    if in_units and tally.pressure > bodies.e_star:
        doubts.append(
            f"the largest nominal pressure is {tally.pressure:.4g} MPa: {modulus}"
        )
    return doubts
