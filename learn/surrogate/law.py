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
from learn.surrogate import points
from learn.surrogate.curves import QUANTITIES, Curve, by_delta, by_pressure, pressures_from
from learn.surrogate.model import OnSurface, Surrogate
from learn.surrogate.sources import Options, deltas_from, files_in, is_table, read_surface

Values = NDArray[np.float64]

STEPS = 40
"""Displacements of a law unless they are given, over the training's range."""


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
class Law:
    """Tables of a contact law.

    Attributes
    ----------
    delta : (k,) far-field displacement, from 0 on [um]
    outside : (k,) share of the surfaces that are outside the training ranges there
    by_delta : curves over Delta by name of the quantity
    pressure : (m,) nominal pressure [MPa]
    by_pressure : curves over the pressure; Delta among them
    e_star : E* [MPa]
    band : what the band is, in words
    notes : how it was made, a line each
    """

    delta: Values
    outside: Values
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
    if order.pressure:
        pressures_from(order.pressure)
    low, high = surrogate.card["delta"]
    given = order.delta or f"{low!r}:{high!r}:{STEPS}"
    deltas = np.unique(deltas_from(given))
    e_star = surrogate.modulus if order.e_star is None else order.e_star
    surfaces, notes = _surfaces(surrogate, order, say)
    tables, outside = _tables(surfaces, deltas, order, e_star)
    alone = len(surfaces) == 1
    if alone:
        band = f"{100 * order.level:g} % conformal interval"
        if order.solver:
            band = "none: solved"
    else:
        band = f"quantiles of {len(surfaces)} surfaces, {100 * order.level:g} % between them"
    how = "solved contact by contact" if order.solver else f"predicted by {surrogate.card['title']}"
    beyond = np.count_nonzero(outside)
    if beyond:
        notes.append(
            f"warning: {beyond} of {outside.size} points are outside the training"
            " ranges: no band holds there; python -m learn predict says why"
        )
    start = _at_rest(surfaces)
    curves, corrected = by_delta(deltas, tables, start, order.level)
    if corrected > 0.01:
        notes.append(
            f"warning: made monotone by up to {100 * corrected:.2g} % of the largest value"
        )
    deltas = np.concatenate([[0.0], deltas])
    share = np.concatenate([[0.0], outside.mean(axis=0)])
    pressure, over_pressure = by_pressure(deltas, curves, order.pressure)
    return Law(deltas, share, curves, pressure, over_pressure, e_star, band, (how, *notes))


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
    surfaces: list[OnSurface],
    deltas: Values,
    order: Order,
    e_star: float,
) -> tuple[dict[str, Values], NDArray[np.bool_]]:
    """(surfaces, 3, k) value, low and high of each quantity; (surfaces, k) what is outside."""
    one = points.solved if order.solver else points.predicted
    parts: list[dict[str, Values]] = []
    outside: list[NDArray[np.bool_]] = []
    with RunProgress(len(surfaces), "surfaces") as progress:
        for surface in surfaces:
            found, beyond = one(surface, deltas, order.level, e_star)
            parts.append(found)
            outside.append(beyond)
            progress.advance(1, 0)
    return {name: np.stack([each[name] for each in parts]) for name in QUANTITIES}, np.stack(
        outside
    )


def _at_rest(surfaces: list[OnSurface]) -> dict[str, Values]:
    """The values at Delta = 0, for each surface."""
    zeros = np.zeros(len(surfaces))
    heights = (each.surface.heights for each in surfaces)
    gap = np.array([float(each.max()) - float(each.mean()) for each in heights])
    return {name: gap if name == "mean_gap_um" else zeros for name in QUANTITIES}
