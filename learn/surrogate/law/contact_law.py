"""Contact laws: area, force and mean gap against Delta and nominal pressure, monotone, with slopes.

A finite-element code needs them at an integration point. A law comes from a surrogate, or from the
solver, contact by contact at the given loads. It is that of one surface, or the mean and quantiles
over the surfaces of a population, at given Delta and at given pressure.

Where no surrogate was trained on the mean gap, it follows from the force: it is (z_max - mean z) -
Delta plus the mean displacement. The latter is linear in the pressures and, for a given patch,
nearly F / (E* L) times a number that depends on the place of the load, and that comes from the
coarse contact solve.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from bem.spacing import Boundary
from gen.runtime.errors import InputError
from learn.arrays import Values
from learn.reading import Reading
from learn.surrogate.bodies import Bodies
from learn.surrogate.law import predicted, solved
from learn.surrogate.law.curves import Curves
from learn.surrogate.law.subjects import Subjects, is_scene, read_subjects, scene_of
from learn.surrogate.model import Surrogate
from learn.surrogate.sources import deltas_from, pressures_from

STEPS = 40
"""Number of displacements over the range of the training or the scene, where no load is given."""


@dataclass(frozen=True)
class Order:
    """A request for a law.

    Attributes
    ----------
    inputs : tuple of str
        Surfaces, folders of them, databases or scenes.
    delta : str
        Far-field displacements as text; "" for the range of the training, or at the pressures.
    pressure : str
        Nominal pressures as text; "" for those at the displacements.
    solver : bool
        True to solve instead of predicting.
    surfaces : int
        Number of surfaces of a database's or scene's population.
    level : float
        Coverage of the band.
    e_star : float, optional
        E*; by default that of the training or the scene, else 1 MPa [MPa].
    hardness : float, optional
        Hardness of the softer body; by default the only one of the training or the scene [MPa].
    boundary : {"free", "periodic", "mirror"}, optional
        Boundary of the patches; by default that of the training or of the scenes, else mirror: a
        law is about a piece of a larger surface.
    reading : Reading
        Options that say how files are read.
    command : str
        Command line, for the record.
    """

    inputs: tuple[str, ...]
    delta: str = ""
    pressure: str = ""
    solver: bool = False
    surfaces: int = 50
    level: float = 0.9
    e_star: float | None = None
    hardness: float | None = None
    boundary: Boundary | None = None
    reading: Reading = field(default_factory=Reading)
    command: str = ""


@dataclass(frozen=True, eq=False)
class Law:
    """Tables of a contact law.

    Attributes
    ----------
    order : Order
        The request.
    over_delta : Curves
        Table against the far-field displacement, which begins at 0 [um].
    over_pressure : Curves
        Table against the nominal pressure, with Delta among its curves [MPa].
    bodies : Bodies
        E* and hardness.
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patches.
    band : str
        Description of the band.
    origins : tuple of str
        Surfaces of the law, one line for each input.
    notes : tuple of str
        Remarks about the making of the law, one line each.
    """

    order: Order
    over_delta: Curves
    over_pressure: Curves
    bodies: Bodies
    boundary: Boundary
    band: str
    origins: tuple[str, ...]
    notes: tuple[str, ...]


def make(surrogate: Surrogate | None, order: Order, say: Callable[[str], None]) -> Law:
    """Make a law.

    Parameters
    ----------
    surrogate : Surrogate or None
        Surrogate that predicts. Where contacts are solved it may be None, and only its E* and its
        range of Delta are used, unless they are given.
    order : Order
        The request.
    say : callable
        Called with a line for the user about each file.

    Raises
    ------
    InputError
        For input that cannot be used, or a pressure that the law does not reach.
    """
    if not order.solver:
        _check_surrogate(surrogate)
    deltas = np.unique(deltas_from(order.delta)) if order.delta else None
    pressures = np.unique(pressures_from(order.pressure)) if order.pressure else None
    boundary = _boundary(surrogate, order)
    subjects = read_subjects(order.inputs, order.surfaces, order.reading, boundary, say)
    bodies = _bodies(surrogate, order, subjects)
    if deltas is None and (pressures is None or not order.solver):
        deltas = _usual_deltas(surrogate, subjects)
    if order.solver:
        over_delta, over_pressure, notes = solved.tables(
            subjects.surfaces, deltas, pressures, order.level, bodies
        )
        how = f"solved contact by contact{_edges(boundary)}"
    else:
        assert surrogate is not None
        assert deltas is not None
        over_delta, over_pressure, notes = predicted.tables(
            surrogate, subjects.surfaces, deltas, pressures, order.level, bodies
        )
        how = f"predicted by {surrogate.card['title']}{_edges(boundary)}"
    return Law(
        order=order,
        over_delta=over_delta,
        over_pressure=over_pressure,
        bodies=bodies,
        boundary=boundary,
        band=_band(order, len(subjects.surfaces)),
        origins=tuple(subjects.origins),
        notes=(how, *(each for each in subjects.origins if ": " in each), *notes),
    )


def _check_surrogate(surrogate: Surrogate | None) -> None:
    if surrogate is None:
        raise InputError("a law needs a surrogate, or --solver, which needs none")
    if not {"area", "force"} <= set(surrogate.learnt):
        raise InputError("a law needs a surrogate of both area and force: fit --target both")


def _boundary(surrogate: Surrogate | None, order: Order) -> Boundary:
    """Return the boundary of the options, the surrogate or the first scene; else mirror."""
    if surrogate is not None and order.boundary in {None, surrogate.boundary}:
        return surrogate.boundary
    if surrogate is not None and not order.solver:
        raise InputError(
            f"--boundary {order.boundary}: the surrogate was trained on patches with a"
            f" {surrogate.boundary} one: leave that out, or fit one to a database of this boundary"
        )
    if order.boundary is not None:
        return order.boundary
    scenes = [text for text in order.inputs if is_scene(text)]
    return scene_of(scenes[0]).contact.boundary if scenes else "mirror"


def _edges(boundary: Boundary) -> str:
    """Describe patches without edges; "" for free ones."""
    return "" if boundary == "free" else f", patches without edges: {boundary} boundary"


def _bodies(surrogate: Surrogate | None, order: Order, subjects: Subjects) -> Bodies:
    """Return E* and hardness of the options, the surrogate's training or the scenes; else 1 MPa."""
    e_star, hardness = order.e_star, order.hardness
    if e_star is None:
        e_star = (subjects.modulus() or 1.0) if surrogate is None else surrogate.modulus
    if hardness is None and (ratio := subjects.hardness_ratio()) is not None:
        hardness = ratio * e_star
    if surrogate is not None and not (order.solver and hardness is not None):
        ratio = surrogate.hardness_ratio(hardness, e_star)
        hardness = None if ratio is None else ratio * e_star
    return Bodies(e_star, hardness, known=order.e_star is not None)


def _usual_deltas(surrogate: Surrogate | None, subjects: Subjects) -> Values:
    """Return displacements over the range of the training or of the scenes [um]."""
    limits = subjects.displacements() if surrogate is None else surrogate.card["delta"]
    if limits is None:
        raise InputError("give --delta or --pressure: without a surrogate nothing says a range")
    low, high = limits
    deltas = np.unique(np.linspace(float(low), float(high), STEPS))
    if not deltas[-1] > 0:
        raise InputError("give --delta or --pressure: the scene presses nothing")
    return deltas[deltas > 0]


def _band(order: Order, surfaces: int) -> str:
    """Describe the band."""
    share = f"{100 * order.level:g} %"
    if surfaces > 1:
        return f"quantiles of {surfaces} surfaces, {share} between them"
    if order.solver:
        return "none, one surface was solved"
    return f"{share} conformal interval"
