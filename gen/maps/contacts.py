"""Contacts of one surface under one load or several: solutions, answers, warnings, rows."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gen.maps.prepare import is_tilted
from gen.maps.read import Topography
from gen.material import Bodies, loads_from, require_within
from gen.runtime import memory
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress

if TYPE_CHECKING:
    from bem import Contact


@dataclass(frozen=True)
class Wanted:
    """Answers that are asked for beside area, force and gap."""

    spots: bool = False  # whether spots are counted
    stiffness: bool = False  # whether the stiffness is solved for
    # conductivities of both bodies, which ask for the conductance [W/(m K)]
    conductivities: tuple[float, float] | None = None
    grid_error: bool = False  # whether the area in the continuum comes with the grid's error
    flow: bool = False  # whether a fluid flows through the gap, along either axis


class Answer(NamedTuple):
    """One number of a contact, as a line of a report and as a cell of a table."""

    column: str  # name of the column in tables
    value: float | int | str  # value in `unit`; "" where there is none
    # name and unit for people, with a remark where one is due
    label: str
    unit: str
    error: float = 0.0  # of the value, from whose second digit on people see none; 0 for rounding

    @property
    def shown(self) -> str:
        """The value as text for people, with as many digits as are true."""
        if not isinstance(self.value, float):
            return str(self.value) or "-"
        if not 0 < self.error < math.inf:
            return f"{self.value:.6g}"
        return f"{self.value:.{max(1 - math.floor(math.log10(self.error)), 0)}f}"


def require_conductivities(given: Sequence[float]) -> tuple[float, float]:
    """Return the conductivities of both bodies [W/(m K)], the same for both if one is given."""
    if len(given) > 2:
        raise InputError(f"--conductivity was given {len(given)} times: give it once or twice")
    for conductivity in given:
        require_within("--conductivity", conductivity, "W/(m K)")
    return given[0], given[-1]


def answers(contact: Contact, wanted: Wanted) -> list[Answer]:
    """Return what is known of a solved contact, and compute the answers that are asked for."""
    problem, (nx, ny) = contact.problem, contact.pressure.shape
    yielding: list[Answer] = []
    if problem.hardness is not None:
        depth = float(contact.yielded_depth.max())
        yielding = [
            Answer("hardness_MPa", problem.hardness, "hardness", "MPa"),
            Answer("yielded_percent", contact.yielded_percent, "yielded nodes", "% of all nodes"),
            Answer("largest_yielded_depth_um", depth, "largest yielded depth", "um"),
        ]
    edgeless = [Answer("boundary", problem.boundary, "boundary", "")]
    nominal = contact.force / nominal_area(contact)
    return [
        Answer("delta_um", contact.delta, "displacement Delta", "um"),
        Answer("approach_um", contact.approach, "far-field displacement",
               "um, Delta and the compliance of the far field"),
        Answer("force_uN", contact.force, "force", "uN"),
        Answer("pressure_MPa", nominal, "nominal pressure", "MPa, force over the whole patch"),
        Answer("area_percent", contact.area_percent, "effective contact area", "% of the nodes"),
        Answer("contact_nodes", contact.contact_nodes, "contact nodes", f"of {nx} x {ny}"),
        Answer("largest_pressure_MPa", contact.largest_pressure, "largest pressure", "MPa"),
        Answer("mean_gap_um", contact.mean_gap, "mean gap", "um"),
        Answer("perimeter_um", contact.perimeter, "contact perimeter", "um"),
        Answer("modulus_MPa", problem.modulus, "modulus E*", "MPa"),
        *(edgeless if problem.boundary != "free" else []),
        *yielding,
        *further(contact, wanted),
        Answer("residual", contact.residual, "residual", "of Delta"),
    ]  # fmt: skip


def further(contact: Contact, wanted: Wanted) -> list[Answer]:
    """Compute the answers that are asked for; see `answers`."""
    found: list[Answer] = []
    if wanted.grid_error:
        error, area = contact.grid_error(), contact.continuum_area_percent
        bar, resolved = error.area_percent, error.resolved
        unit = f"+- {bar:.2g} %, in 9 of 10 cases" if resolved else "% on this grid"
        said = "yes" if resolved else "no"
        found = [
            Answer("continuum_area_percent", area, "area in the continuum", unit, bar),
            Answer("continuum_area_error_percent", bar if resolved else "", "its error", "%", bar),
            Answer("resolved", said, "resolved by the grid", error.reason),
        ]
    found += _spots(contact) if wanted.spots else []
    try:
        for axis, name in enumerate("xy" if wanted.flow else ""):
            flow = contact.flow(axis)
            seals = "no flow: the contact seals"
            said = "of the flow through the mean gap" if flow.factor else seals
            found += [
                Answer(f"flow_factor_{name}", flow.factor, f"flow factor along {name}", said),
                Answer(f"hydraulic_aperture_{name}_um", flow.aperture,
                       f"hydraulic aperture along {name}", "um"),
            ]  # fmt: skip
        if wanted.stiffness or wanted.conductivities is not None:
            found += _interface(contact, wanted)
    except ArithmeticError as error:
        raise InputError(str(error)) from None
    return found


def _spots(contact: Contact) -> list[Answer]:
    """Return the answers about spots of contact."""
    spots, cell = contact.spots, math.prod(contact.problem.spacing)
    mean, largest = (spots.areas.mean(), spots.areas[0]) if spots.number else (0.0, 0.0)
    share = 100 * spots.largest_share
    sides = {
        name: " and ".join(axis for axis, each in zip("xy", connects, strict=True) if each) or "no"
        for name, connects in (("contact", spots.contact_connects), ("gap", spots.gap_connects))
    }
    return [
        Answer("spots", spots.number, "spots of contact", "nodes that touch along their sides"),
        Answer("mean_spot_um2", float(mean), "mean spot", f"um2, a node has {cell:.4g}"),
        Answer("largest_spot_um2", float(largest), "largest spot", "um2"),
        Answer("largest_spot_percent", share, "its share", "% of the contact area"),
        Answer("contact_connects", sides["contact"], "contact connects sides", "directions"),
        Answer("gap_connects", sides["gap"], "gap connects sides", "directions"),
    ]  # fmt: skip


def _interface(contact: Contact, wanted: Wanted) -> list[Answer]:
    """Return the answers about stiffness and conductance; MPa um are N/m, W/(m K) um are uW/K."""
    free = contact.problem.boundary == "free"
    alone = ", without the patch's own constriction" if free else ""
    if contact.interface_stiffness == math.inf:
        alone = ": full contact, in which nothing but the bodies is left"
    found = []
    if wanted.stiffness:
        yields, stiff = contact.problem.hardness is not None, contact.interface_stiffness
        found = [
            Answer("stiffness_N_per_m", contact.stiffness, "stiffness", "N/m, of unloading"),
            *([Answer("loading_stiffness_N_per_m", contact.loading_stiffness,
                      "stiffness of loading", "N/m, dF/dDelta")] if yields else []),
            Answer("interface_stiffness_N_per_m", stiff, "interface's stiffness", f"N/m{alone}"),
        ]  # fmt: skip
    if wanted.conductivities is not None:
        whole = 1e-6 * contact.conductance(*wanted.conductivities)
        interface = contact.interface_conductance(*wanted.conductivities)
        found += [
            Answer("conductance_W_per_K", whole, "conductance", "W/K"),
            Answer("interface_conductance_W_per_K", 1e-6 * interface, "interface's conductance",
                   f"W/K{alone}"),
            Answer("interface_conductance_W_per_m2_K", 1e6 * interface / nominal_area(contact),
                   "per nominal area", f"W/(m2 K){alone}"),
        ]  # fmt: skip
    return found


def nominal_area(contact: Contact) -> float:
    """Return the area of the cells of all nodes, over which a mean pressure is taken [um2]."""
    return contact.pressure.size * math.prod(contact.problem.spacing)


OUTER = 0.05  # share of the lines of nodes on each side whose load is told apart
# how messages write a load
SHOWN = {"delta": "Delta = {:.6g} um", "force": "{:.6g} uN", "pressure": "{:.6g} MPa"}
# E* over the pressure from which a warning is due: the hardness of steel is 2 GPa at 230 GPa, and
# only glasses, ceramics and rubber bear more than a hundredth of E*
YIELDING = 100


def chosen_load(given: dict[str, str]) -> tuple[str, list[float]]:
    """Return the name and the values of the load that the user gave by one of the options."""
    chosen = [name for name in SHOWN if given[name]]
    if len(chosen) != 1:
        said = " and ".join(f"--{name}" for name in chosen) or "no load"
        raise InputError(f"{said} given: give one of --delta, --force and --pressure")
    name, advice = chosen[0], "give a number, several as 1,2,5, or start:stop:count[:log]"
    return name, loads_from(name, given[name], advice)


def solve_loads(
    topography: Topography, load: str, values: Sequence[float], **settings: Any
) -> Iterator[tuple[Contact | None, str]]:
    """Solve a surface under one load after another; yield no contact but a fault if one fails.

    A load under which the solver does not converge costs only itself, unless none does. Raises
    InputError if a number is not allowed, there is no solution, or memory is too short.
    """
    import bem
    from bem.problem import pose

    heights, sides = topography.heights, topography.sides
    settings |= {"boundary": topography.boundary, "spacing": topography.apart}
    loads: dict[str, Any] = {f"{load}s": values}
    solved = 0
    try:
        if len(values) > 1:  # the largest load is refused before the first is solved
            largest: dict[str, Any] = {"delta": None, load: max(values)}
            pose(heights, sides, **largest, **settings)
        contacts = bem.ladder(heights, sides, **loads, **settings)
        for value in values:
            try:
                yield next(contacts), ""
                solved += 1
            except bem.NotConverged as error:
                shown = f"{SHOWN[load].format(value)}: " if len(values) > 1 else ""
                if not solved and value == values[-1]:
                    raise ValueError(f"{shown}{error}") from None
                yield None, f"{shown}{error}"
    except ValueError as error:
        raise InputError(f"{topography.name}: {error}") from None
    except MemoryError:
        short = memory.too_little_for_solve(topography.heights.shape)
        raise InputError(f"{topography.name}: {short}") from None


def follow(
    solutions: Iterator[tuple[Contact | None, str]], many: int, wanted: Wanted
) -> tuple[list[list[Answer]], Contact, list[str], float]:
    """Solve under many loads and show the progress; the last contact alone is kept.

    Returns what is known of each contact, the last one, a line for each load that was not solved,
    and the time of the last solve [s].
    """
    rows, faults, seconds, last = [], [], 0.0, None
    with RunProgress(many, "loads") if many > 1 else nullcontext() as progress:
        # Nothing is printed before the first contact is solved, since its load may be refused.
        for _ in range(many):
            began = time.perf_counter()
            contact, fault = next(solutions)
            seconds = time.perf_counter() - began
            if contact is None:
                faults.append(f"not solved, left out: {fault}")
            else:
                rows.append(answers(contact, wanted))
                last = contact
            if progress is not None:
                progress.advance(1, contact is None)
    assert last is not None  # else the last load is refused
    return rows, last, faults, seconds


def contact_warnings(
    topography: Topography, bodies: Bodies, load: str, solved: Sequence[tuple[float, float, int]]
) -> Iterator[str]:
    """Yield reasons to distrust contacts of a surface: full contact, and pressures that yield.

    `solved` has Delta [um], the largest pressure [MPa] and the number of nodes of each contact
    under the kind of load.
    """
    largest = max(pressure for _, pressure, _ in solved)
    limit = bodies.e_star / YIELDING
    # without a material, a force or a pressure scales with an E* that nobody gave
    unscaled = load != "delta" and not bodies.known
    check = bodies.stated if unscaled else "check the load and the unit of the heights"
    full = [delta for delta, _, nodes in solved if nodes == topography.heights.size]
    beyond = [delta for delta, pressure, _ in solved if pressure > limit]
    if full:
        span = f"{np.ptp(topography.heights):.4g}"
        start = f"from Delta = {min(full):.4g} um on every node touches"
        yield f"{start}, the heights span {span} um: {check}"
    elif largest > bodies.e_star and unscaled:
        yield f"the largest pressure is {largest:.4g} MPa: {check}"
    if beyond and bodies.known and bodies.hardness is None:
        start = f"from Delta = {min(beyond):.4g} um on, " if len(solved) > 1 else ""
        units = ", and check E*: moduli count in MPa (210e3)" * (largest > bodies.e_star)
        yield (
            f"{start}the largest pressure ({largest:.4g} MPa) is above E*/{YIELDING:g} ="
            f" {limit:.4g} MPa: real metals and polymers would have yielded, and their contact area"
            f" is larger than this elastic one; give --hardness{units}"
        )


def border_remark(topography: Topography, last: Contact, loads: int) -> str:
    """Say which share of the last force the borders of a free patch carry, if that is known."""
    pressure = last.pressure
    outer = [int(OUTER * nodes) for nodes in pressure.shape]
    if topography.boundary != "free" or min(outer) < 1 or not pressure.any():
        return ""
    (nx, ny), (x, y) = pressure.shape, outer
    share = 1 - float(pressure[x : nx - x, y : ny - y].sum() / pressure.sum())
    nodes = 1 - (nx - 2 * x) * (ny - 2 * y) / pressure.size
    said = (
        f"the outer 5 % on each side ({100 * nodes:.2g} % of the nodes) carry {100 * share:.3g} %"
        f" of the {'last ' if loads > 1 else ''}force"
    )
    if is_tilted(topography):  # whose mirror images are tilted too
        return said
    return f"{said}: if this is a piece of a larger surface, --boundary mirror leaves no edges"
