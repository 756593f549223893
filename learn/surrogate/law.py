"""Contact laws: area, force and mean gap against Delta and nominal pressure, monotone, with slopes.

What a finite-element code needs at a Gauss point. Laws come from the surrogate, or contact by
contact from the solver; of one surface, or of a population as mean and quantiles over its surfaces.

The mean gap follows from the force where no surrogate was trained on it: it is (z_max - mean z)
- Delta plus the mean displacement, which is exactly linear in the pressures and, for a given patch,
nearly F / (E* L) times a number that says where the load sits: the coarse contact solve's.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.errors import InputError
from gen.progress import RunProgress
from gen.scene import preset_names
from gen.single import chosen_load, solve_loads
from gen.table import Row, write_csv
from gen.topography import Topography
from learn.surrogate import header
from learn.surrogate.model import OnSurface, Surrogate
from learn.surrogate.sources import Options, deltas_from, files_in, is_table, read_surface

Values = NDArray[np.float64]

QUANTITIES = ("area_percent", "force_uN", "mean_gap_um", "pressure_MPa")
RISING = {"area_percent": True, "force_uN": True, "mean_gap_um": False, "pressure_MPa": True}
STEPS = 40
"""Displacements of a law unless they are given, over the training's range."""

FINE = 400
"""Displacements between which the law against pressure is interpolated."""


@dataclass(frozen=True)
class Order:
    """What law is wanted.

    Attributes
    ----------
    inputs : a surface, folders of them, a database or a scene
    delta : displacements as text, "" for the training's range
    pressure : nominal pressures as text, "" for those at the displacements
    solver : True to solve instead of predicting
    surfaces : of the population of a database or scene
    level : coverage of the band
    e_star : E*, None for the training's [MPa]
    options : how files are read
    """

    inputs: tuple[str, ...]
    delta: str = ""
    pressure: str = ""
    solver: bool = False
    surfaces: int = 50
    level: float = 0.9
    e_star: float | None = None
    options: Options = field(default_factory=Options)


@dataclass(frozen=True, eq=False)
class Curve:
    """One quantity against an argument.

    Attributes
    ----------
    value, low, high, slope : (k,) in the quantity's unit, slope over the argument's unit
    """

    value: Values
    low: Values
    high: Values
    slope: Values


@dataclass(frozen=True, eq=False)
class Law:
    """Tables of a contact law.

    Attributes
    ----------
    delta : (k,) far-field displacement, from 0 on [um]
    by_delta : curves over Delta by name of the quantity
    pressure : (m,) nominal pressure [MPa]
    by_pressure : curves over the pressure; Delta among them
    e_star : E* [MPa]
    band : what the band is, in words
    notes : how it was made, a line each
    """

    delta: Values
    by_delta: dict[str, Curve]
    pressure: Values
    by_pressure: dict[str, Curve]
    e_star: float
    band: str
    notes: tuple[str, ...]


def make(surrogate: Surrogate, order: Order, say: Callable[[str], None]) -> Law:
    """Make a law.

    Raises
    ------
    InputError
        For input that cannot be used, or a pressure that the law does not reach.
    """
    if not order.solver and not {"area", "force"} <= set(surrogate.learnt):
        raise InputError("a law needs a surrogate of both area and force: fit --target both")
    low, high = surrogate.card["delta"]
    given = order.delta or f"{low!r}:{high!r}:{STEPS}"
    deltas = np.unique(deltas_from(given))
    e_star = surrogate.modulus if order.e_star is None else order.e_star
    surfaces, notes = _surfaces(surrogate, order, say)
    tables, outside = _tables(surrogate, surfaces, deltas, order, e_star)
    alone = len(surfaces) == 1
    if alone:
        band = f"{100 * order.level:g} % conformal interval"
        if order.solver:
            band = "none: solved"
    else:
        band = f"quantiles of {len(surfaces)} surfaces, {100 * order.level:g} % between them"
    how = "solved contact by contact" if order.solver else f"predicted by {surrogate.card['title']}"
    if outside and not order.solver:
        notes.append(
            f"warning: {outside} of {deltas.size * len(surfaces)} points are outside the training"
            " ranges: python -m learn predict says where"
        )
    start = _at_rest(surfaces)
    curves, corrected = _by_delta(deltas, tables, start, order.level)
    if corrected > 0.01:
        notes.append(
            f"warning: made monotone by up to {100 * corrected:.2g} % of the largest value"
        )
    deltas = np.concatenate([[0.0], deltas])
    pressure, by_pressure = _by_pressure(deltas, curves, order.pressure)
    return Law(deltas, curves, pressure, by_pressure, e_star, band, (how, *notes))


def write(law: Law, table: Path | None, c_header: Path | None) -> list[Path]:
    """Write a law as CSV and as a C header, where asked for."""
    written = []
    if table is not None:
        write_csv(table, list(_rows(law)))
        written.append(table)
    if c_header is not None:
        header.write(c_header, law)
        written.append(c_header)
    return written


def show(law: Law) -> None:
    """Print the law against Delta."""
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if Console().is_terminal else 120)
    for note in law.notes:
        console.print(note, highlight=False, markup=False, soft_wrap=True)
    table = Table(title=f"E* = {law.e_star:g} MPa; band: {law.band}")
    table.add_column("delta_um", justify="right")
    for name in QUANTITIES:
        table.add_column(name, justify="right")
    for place, delta in enumerate(law.delta):
        cells = [f"{delta:.5g}"]
        for name in QUANTITIES:
            curve = law.by_delta[name]
            low, high = curve.low[place], curve.high[place]
            ends = f" ({low:.4g} to {high:.4g})" if low < high else ""
            cells.append(f"{curve.value[place]:.4g}{ends}")
        table.add_row(*cells)
    console.print(table)


def _surfaces(
    surrogate: Surrogate, order: Order, say: Callable[[str], None]
) -> tuple[list[OnSurface], list[str]]:
    """Surfaces of the files, or a population of a database or scene."""
    found: list[OnSurface] = []
    notes: list[str] = []
    for text in order.inputs:
        path = Path(text)
        if text in preset_names() or path.suffix.lower() in {".toml", ".h5"}:
            found += _population(surrogate, text, order.surfaces)
            notes.append(f"{text}: its first {order.surfaces} surfaces")
            continue
        for file in files_in([path])[0]:
            if is_table(file):
                raise InputError(f"{file}: a law needs surfaces, not their statistics")
            topography, warnings = read_surface(file, order.options)
            say(f"{file}: {'; '.join(topography.steps)}")
            for line in warnings:
                say(f"  warning: {line}")
            found.append(surrogate.for_surface(topography.heights, topography.sides, str(file)))
    return found, notes


def _population(surrogate: Surrogate, text: str, number: int) -> Iterator[OnSurface]:
    """The first surfaces of a database or scene, generated anew."""
    from gen.plan import parameters
    from gen.sample import surface_of
    from gen.scene import load

    if text.lower().endswith(".h5"):
        from gen.database import Reader

        with Reader(Path(text)) as reader:
            scene = reader.scene
    else:
        scene = load(text)
    step = scene.samples_per_surface
    plan = parameters(scene, 0, step * number)
    for surface in range(number):
        heights = surface_of(scene, plan, step * surface)
        yield surrogate.for_surface(heights, scene.surface.side, f"{text}, surface {surface}")


def _tables(
    surrogate: Surrogate,
    surfaces: list[OnSurface],
    deltas: Values,
    order: Order,
    e_star: float,
) -> tuple[dict[str, Values], int]:
    """(surfaces, 3, k): value, low and high of each quantity; and how many points are outside."""
    one = _solved if order.solver else _predicted
    parts: list[dict[str, Values]] = []
    outside = 0
    with RunProgress(len(surfaces), "surfaces") as progress:
        for surface in surfaces:
            found, beyond = one(surrogate, surface, deltas, order.level, e_star)
            parts.append(found)
            outside += beyond
            progress.advance(1, 0)
    return {name: np.stack([each[name] for each in parts]) for name in QUANTITIES}, outside


def _predicted(
    surrogate: Surrogate, pressed: OnSurface, deltas: Values, level: float, e_star: float
) -> tuple[dict[str, Values], int]:
    """One surface's law from the surrogate."""
    answer = pressed.predict(deltas, e_star=e_star, level=level)
    area = np.stack([answer.area, answer.low["area"], answer.high["area"]])
    force = np.stack([answer.force, answer.low["force"], answer.high["force"]])
    if "mean_gap" in answer.values:
        ends = answer.low["mean_gap"], answer.high["mean_gap"]
        gap = np.stack([answer.values["mean_gap"], *ends])
    else:
        gap = _mean_gap(pressed, deltas, force[[0, 2, 1]] / e_star)[[0, 2, 1]]
        gap = np.sort(gap, axis=0)[[1, 0, 2]]
    found = {
        "area_percent": area,
        "force_uN": force,
        "mean_gap_um": gap,
        "pressure_MPa": force / _nominal(pressed),
    }
    return found, int(np.count_nonzero(~answer.inside))


def _solved(
    surrogate: Surrogate, pressed: OnSurface, deltas: Values, level: float, e_star: float
) -> tuple[dict[str, Values], int]:
    """One surface's law from the solver, which has no band."""
    surface = pressed.surface
    topography = Topography(surface.name, surface.heights, surface.sides)
    contacts = [
        contact for contact, _ in solve_loads(topography, "delta", list(deltas), modulus=e_star)
    ]
    force = np.array([contact.force for contact in contacts])
    found = {
        "area_percent": np.array([contact.area_percent for contact in contacts]),
        "force_uN": force,
        "mean_gap_um": np.array([contact.mean_gap for contact in contacts]),
        "pressure_MPa": force / _nominal(pressed),
    }
    return {name: np.stack([values] * 3) for name, values in found.items()}, 0


def _mean_gap(pressed: OnSurface, deltas: Values, force: Values) -> Values:
    """Mean gap from forces over E*, (3, k) as they are [um]."""
    surface = pressed.surface
    heights = surface.heights
    rest = float(heights.max()) - float(heights.mean())
    compliance = np.array([surface.compliance(float(delta)) for delta in deltas])
    return np.maximum(rest - deltas + compliance * force / surface.length, 0.0)


def _nominal(pressed: OnSurface) -> float:
    """Area of the cells of all nodes, over which the nominal pressure is a mean [um2]."""
    steps, shape = pressed.surface.steps, pressed.surface.heights.shape
    return float(steps[0] * steps[1] * shape[0] * shape[1])


def _at_rest(surfaces: list[OnSurface]) -> dict[str, Values]:
    """The values at Delta = 0, for each surface."""
    zeros = np.zeros(len(surfaces))
    heights = (each.surface.heights for each in surfaces)
    gap = np.array([float(each.max()) - float(each.mean()) for each in heights])
    return {name: gap if name == "mean_gap_um" else zeros for name in QUANTITIES}


def _by_delta(
    deltas: Values, tables: dict[str, Values], rest: dict[str, Values], level: float
) -> tuple[dict[str, Curve], float]:
    """Monotone curves over Delta, from 0 on, and the largest relative correction."""
    curves: dict[str, Curve] = {}
    corrected = 0.0
    arguments = np.concatenate([[0.0], deltas])
    for name, table in tables.items():
        start = np.repeat(rest[name][:, None, None], 3, axis=1)
        whole = np.concatenate([start, table], axis=2)
        if len(whole) == 1:
            value, low, high = whole[0]
        else:
            value = whole[:, 0].mean(axis=0)
            low, high = np.quantile(whole[:, 0], [(1 - level) / 2, (1 + level) / 2], axis=0)
        smooth = [_monotone(each, rising=RISING[name]) for each in (value, low, high)]
        largest = float(np.abs(value).max()) or 1.0
        corrected = max(corrected, float(np.abs(smooth[0] - value).max()) / largest)
        value, low, high = smooth
        curves[name] = Curve(
            value, np.minimum(low, value), np.maximum(high, value), _slope(arguments, value)
        )
    return curves, corrected


def _monotone(values: Values, *, rising: bool) -> Values:
    """The closest monotone values, by least squares."""
    from scipy.optimize import isotonic_regression

    return np.asarray(isotonic_regression(values, increasing=rising).x)


def _slope(arguments: Values, values: Values) -> Values:
    """Slopes of the monotone cubic through the values."""
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(arguments, values).derivative()(arguments))


def _by_pressure(
    deltas: Values, curves: dict[str, Curve], text: str
) -> tuple[Values, dict[str, Curve]]:
    """The same curves against the nominal pressure."""
    from scipy.interpolate import PchipInterpolator

    fine = np.unique(np.concatenate([deltas, np.linspace(0, deltas[-1], FINE)]))
    reached = PchipInterpolator(deltas, curves["pressure_MPa"].value)(fine)
    rising = np.concatenate([[True], np.diff(np.maximum.accumulate(reached)) > 0])
    fine, reached = fine[rising], reached[rising]
    if reached.size < 2:
        raise InputError("the law has no force at all: nothing to tabulate against pressure")
    pressure = np.unique(curves["pressure_MPa"].value)  # as close as Delta's where it is small
    if text:
        pressure = np.unique(_pressures(text))
        if pressure[-1] > reached[-1]:
            raise InputError(
                f"--pressure {text}: the law ends at {reached[-1]:.4g} MPa, Delta ="
                f" {deltas[-1]:.4g} um: give a larger --delta"
            )
    at = np.interp(pressure, reached, fine)
    found: dict[str, Curve] = {"delta_um": _curve(pressure, at, at, at)}
    for name in ("area_percent", "mean_gap_um"):
        ends = curves[name].value, curves[name].low, curves[name].high
        found[name] = _curve(pressure, *(PchipInterpolator(deltas, each)(at) for each in ends))
    return pressure, found


def _curve(arguments: Values, value: Values, low: Values, high: Values) -> Curve:
    slope = _slope(arguments, value) if arguments.size > 1 else np.zeros(1)
    return Curve(value, low, high, slope)


def _pressures(text: str) -> Values:
    """Nominal pressures from "1:100:20" [MPa]."""
    values = np.array(chosen_load({"delta": "", "force": "", "pressure": text})[1])
    if not (values >= 0).all():
        raise InputError(f"--pressure {text!r}: give pressures of 0 MPa or more")
    return values


def _rows(law: Law) -> Iterator[Row]:
    """Rows of the CSV: the table against Delta, then the one against pressure."""
    for against, arguments, curves in (
        ("delta_um", law.delta, law.by_delta),
        ("pressure_MPa", law.pressure, law.by_pressure),
    ):
        for place, argument in enumerate(arguments):
            row: Row = {"against": against}
            for name in ("delta_um", *QUANTITIES):
                row |= {f"{name}{end}": "" for end in ("", "_low", "_high", "_slope")}
                if name == against:
                    row[name] = float(argument)
                elif name in curves:
                    row |= _cells(name, curves[name], place)
            yield row


def _cells(name: str, curve: Curve, place: int) -> Row:
    return {
        name: float(curve.value[place]),
        f"{name}_low": float(curve.low[place]),
        f"{name}_high": float(curve.high[place]),
        f"{name}_slope": float(curve.slope[place]),
    }
