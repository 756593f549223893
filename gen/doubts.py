"""Reasons to distrust a contact problem, in one wording for all commands.

A slip of a unit or a missing modulus has one of these symptoms, and each is a reason for doubt:

- numbers of a material that no solid has,
- surfaces that are too steep for the theory,
- loads under which every node touches, or at most one,
- pressures at which real bodies yield,
- loads that bodies of the given hardness cannot bear.

A single problem is doubted if one of its contacts has a symptom. A database may have extreme rows
on purpose: it is doubted if more than half of its rows have one, or if any row is sure to fail.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.material import Bodies

LEAST_HARDNESS = 1e-4
GREATEST_HARDNESS = 0.2
"""Bounds of hardness over E* of solids: soft metals have 1e-3, glasses and polymers up to 0.1."""

STIFFEST = 2e6
"""E* that no solid exceeds [MPa]; diamond has 1.2e6 MPa."""

SLIPS = {
    1e-3: "is the modulus in GPa",
    1e3: "is the hardness in GPa",
    1e-6: "is the hardness in Pa",
    1e6: "is the modulus in Pa",
}
"""Questions about likely slips of a unit, by the factor that corrects hardness over E*. The first
one whose corrected ratio is that of a solid is asked."""

YIELDING = 100
"""A pressure above E* / YIELDING gets a warning: the hardness of steel is 2 GPa at an E* of
230 GPa, and only glasses, ceramics and rubber bear more than a hundredth of E*."""

STEEP = 0.3
"""Rms slope below which slopes are small, as the theory of the half-space assumes. The paper's
rough surfaces have 0.10 to 0.44."""

STEEP_ROW = 1.0
"""Rms slope above which a row of a database is too steep; wide populations exceed `STEEP` on
purpose."""

DOUBTED_SHARE = 0.5
"""Share of the rows of a database, or of the surfaces of a law, above which a doubt is reported."""

OPTIONS = "--young or --e-star"
"""Names of the options of commands that give the modulus."""

KEYS = "modulus in [contact]"
"""Name of the key of scenes that gives the modulus."""

CHECK_LOAD = "check the load and the unit of the heights"
"""Advice for loads that do not depend on a missing modulus."""


@dataclass(frozen=True)
class Pressed:
    """Numbers of one solved contact from which doubts follow."""

    delta: float  # far-field displacement [um]
    largest_pressure: float  # [MPa]
    is_full: bool  # whether every node of its grid is in contact


@dataclass(frozen=True, eq=False)
class SolvedRows:
    """Numbers of solved rows of a database from which doubts follow: arrays of shape (rows,)."""

    delta: Values  # far-field displacement [um]
    span: Values  # difference of the highest and the lowest node [um]
    slope: Values  # rms slope between neighbouring nodes [1]; NaN where it is not known
    contact_nodes: Values  # number of nodes in contact
    pressure: Values  # nominal pressure [MPa]


class DeltaOnSurface(NamedTuple):
    """A displacement, and the span of the heights of the surface that it is applied to."""

    delta: float  # [um]
    span: float  # difference of the highest and the lowest node [um]


NO_FULL_CONTACT = DeltaOnSurface(delta=math.inf, span=math.nan)
"""Start of a minimum over rows: Delta is infinite if no row is in full contact."""

NO_SINGLE_NODE = DeltaOnSurface(delta=-math.inf, span=math.nan)
"""Start of a maximum over rows: Delta is minus infinity if every row has two nodes in contact or
more."""


@dataclass(frozen=True)
class Tally:
    """Counts and extremes of rows of a database. Tallies of its parts can be added."""

    rows: int = 0
    full: int = 0  # rows in which every node touches
    full_from: DeltaOnSurface = NO_FULL_CONTACT  # smallest Delta of these rows
    single: int = 0  # rows in which one node touches, or none
    single_to: DeltaOnSurface = NO_SINGLE_NODE  # largest Delta of these rows
    steep: int = 0  # rows whose rms slope is above STEEP_ROW
    steepest: float = 0.0  # largest rms slope of these rows
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
        full = rows.contact_nodes == nodes
        single = rows.contact_nodes <= 1
        steep = rows.slope > STEEP_ROW  # false where the slope is not known
        return cls(
            rows=rows.delta.size,
            full=int(np.count_nonzero(full)),
            full_from=min(_deltas(rows, full), default=NO_FULL_CONTACT),
            single=int(np.count_nonzero(single)),
            single_to=max(_deltas(rows, single), default=NO_SINGLE_NODE),
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


def _deltas(rows: SolvedRows, places: NDArray[np.bool_]) -> list[DeltaOnSurface]:
    """Return the displacements of the rows at `places`, each with the span of its surface."""
    deltas = rows.delta[places].tolist()
    spans = rows.span[places].tolist()
    pairs = zip(deltas, spans, strict=True)
    return [DeltaOnSurface(delta=delta, span=span) for delta, span in pairs]


def material_doubts(bodies: Bodies) -> list[str]:
    """Doubt a hardness over E*, or an E*, that no solid has, and name the likely slip of a unit.

    Parameters
    ----------
    bodies : Bodies
        E* and hardness [MPa].

    Returns
    -------
    list of str
        One line without "warning:"; empty if the material is possible.
    """
    ratio = bodies.hardness_ratio
    if ratio is not None and not _is_of_a_solid(ratio):
        question = "is the modulus left out"
        if bodies.has_modulus:
            question = _likely_slip(ratio)
        if _is_hardness_of_base(bodies):
            question = "is the hardness that of the base and not of the layer"
        bounds = f"solids have {LEAST_HARDNESS:g} to {GREATEST_HARDNESS:g}"
        units = f"Both count in MPa, and E* is {bodies.e_star:.6g} MPa (steel: 230e3)"
        return [f"hardness over E* is {ratio:.3g}, {bounds}: {question}? {units}"]
    if bodies.e_star > STIFFEST:
        modulus = f"E* is {bodies.e_star:.3g} MPa, diamond has 1.2e6"
        return [f"{modulus}: is the modulus in Pa? It counts in MPa (steel: 210e3)"]
    return []


def _is_of_a_solid(ratio: float) -> bool:
    """Return whether there are solids with this hardness over E*."""
    return LEAST_HARDNESS <= ratio <= GREATEST_HARDNESS


def _is_hardness_of_base(bodies: Bodies) -> bool:
    """Return whether a hardness suits the elastic base of a layer, and is too large for the layer.

    The hardness over E* is known to be that of no solid.
    """
    layered, hardness = bodies.layered, bodies.hardness
    if layered is None or layered.base is None or hardness is None:
        return False
    is_too_large = hardness > GREATEST_HARDNESS * bodies.e_star
    return is_too_large and _is_of_a_solid(hardness / layered.base.young)


def _likely_slip(ratio: float) -> str:
    """Return the question about the slip of a unit that explains a hardness over E*.

    It has no question mark. If no slip of `SLIPS` explains the ratio, it is a general one.
    """
    for factor, question in SLIPS.items():
        if _is_of_a_solid(ratio * factor):
            return question
    return "are the units right"


def modulus_in_words(bodies: Bodies, given_by: str = OPTIONS) -> str:
    """Say what E* is and, if it is the default, which option or key gives another one.

    Parameters
    ----------
    bodies : Bodies
        E* [MPa], and whether the user gave it.
    given_by : str
        Options or keys that give the modulus.

    Returns
    -------
    str
        Part of a sentence, without a full stop.
    """
    modulus = f"E* is {bodies.e_star:.6g} MPa"
    if bodies.has_modulus or bodies.e_star != 1.0:
        return modulus
    return f"{modulus}, the default without a modulus ({given_by})"


def steep_slopes(slope: float, apart: float, where: str = "") -> str:
    """Return the warning about a surface that is too steep for the theory of the half-space.

    The caller has found the slope too large.

    Parameters
    ----------
    slope : float
        Rms slope between neighbouring nodes [1].
    apart : float
        Distance of neighbouring nodes [um].
    where : str
        Part of the sentence that says in how many rows the slope is above a limit, with the comma
        before it, as ", above 1 in 7 of 9 rows"; "" for a single surface.

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
    """Return the doubt that every node touches from the displacement `delta` [um] on.

    `span` is the highest minus the lowest height of the surface [um]. `advice` ends the line.
    `where` names the rows in which every node touches, after a blank, as " in 7 of 9 rows". It is
    "" for a single surface.
    """
    return (
        f"from Delta = {delta:.4g} um on every node touches{where}, the heights span"
        f" {span:.4g} um: {advice}"
    )


def contact_doubts(
    heights: Heights, bodies: Bodies, load: str, solved: Sequence[Pressed]
) -> list[str]:
    """Doubt contacts of one surface that are full, or whose pressures make real bodies yield.

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
        One line for each doubt, without "warning:".
    """
    doubts: list[str] = []
    largest = max(contact.largest_pressure for contact in solved)
    # The effect of a force or a pressure depends on E*, which is 1 MPa if the user gave no modulus.
    unscaled = load != "delta" and not bodies.has_modulus
    full = [contact.delta for contact in solved if contact.is_full]
    if full:
        advice = modulus_in_words(bodies) if unscaled else CHECK_LOAD
        doubts.append(_full_contact(min(full), float(np.ptp(heights)), advice))
    elif largest > bodies.e_star and unscaled:
        doubts.append(
            f"the largest pressure is {largest:.4g} MPa: {modulus_in_words(bodies)}"
        )
    if bodies.has_modulus and bodies.hardness is None:
        doubts += _yielding_doubts(bodies, solved, largest)
    return doubts


def _yielding_doubts(
    bodies: Bodies, solved: Sequence[Pressed], largest: float
) -> list[str]:
    """Return a line if real bodies yield at the largest pressure of elastic contacts, else none.

    `largest` is the largest pressure of all contacts [MPa].
    """
    limit = bodies.e_star / YIELDING
    beyond = [contact.delta for contact in solved if contact.largest_pressure > limit]
    if not beyond:
        return []
    start = ""
    if len(solved) > 1:
        start = f"from Delta = {min(beyond):.4g} um on, "
    units = ""
    if largest > bodies.e_star:
        units = ", and check E*: moduli count in MPa (210e3)"
    line = (
        f"{start}the largest pressure ({largest:.4g} MPa) is above E*/{YIELDING:g} ="
        f" {limit:.4g} MPa: real metals and polymers would have yielded, and their contact area"
        f" is larger than this elastic one; give --hardness{units}"
    )
    return [line]


def unborne_loads(rows: int, planned: str, pressure: float) -> str:
    """Doubt loads that are at or above what the hardness bears, so that their rows fail.

    Parameters
    ----------
    rows : int
        Number of the rows with such a load.
    planned : str
        The rows among which these were counted, as "400 rows".
    pressure : float
        The largest nominal pressure of these [MPa].

    Returns
    -------
    str
        The line, without "warning:".
    """
    return (
        f"the hardness does not bear the load of {rows} of {planned}, which will fail: nominal"
        f" pressures reach {pressure:.4g} MPa; give smaller loads or a larger hardness"
    )


def rows_doubts(
    tally: Tally, bodies: Bodies, load: str, apart: float, noun: str = "rows"
) -> list[str]:
    """Doubt a database by its rows, or by rows that were tried before it is made.

    A doubt is reported if more than half of the rows give it. One slip has one line: if surfaces
    are too steep, loads that are too large or too small for them are not reported, and under full
    contact the nominal pressure is not.

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
        Name of the rows in messages, in the plural.

    Returns
    -------
    list of str
        One line for each doubt, without "warning:".
    """
    doubts: list[str] = []
    share = f"of {tally.rows} {noun}"
    half = DOUBTED_SHARE * tally.rows
    scales_with_modulus = load in {"pressure", "force"}
    modulus = modulus_in_words(bodies, KEYS)
    advice = CHECK_LOAD
    if scales_with_modulus and bodies.has_modulus:
        advice = f"{modulus}; {CHECK_LOAD}"
    elif scales_with_modulus:
        advice = modulus
    if tally.steep > half:
        where = f", above {STEEP_ROW:g} in {tally.steep} {share}"
        doubts.append(steep_slopes(tally.steepest, apart, where))
    elif tally.full > half:
        start = tally.full_from
        where = f" in {tally.full} {share}"
        return [_full_contact(start.delta, start.span, advice, where)]
    elif tally.single > half:
        end = tally.single_to
        doubts.append(
            f"up to Delta = {end.delta:.4g} um one node touches at most in {tally.single} {share},"
            f" the heights span {end.span:.4g} um: {advice}"
        )
    if scales_with_modulus and tally.pressure > bodies.e_star:
        doubts.append(
            f"the largest nominal pressure is {tally.pressure:.4g} MPa: {modulus}"
        )
    return doubts
