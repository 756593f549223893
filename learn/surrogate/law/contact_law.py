"""Contact laws: area, force, mean gap and closure against Delta and nominal pressure.

A law comes from a surrogate, or from the solver with the surrogate's material and range. It is that
of one surface, or the mean and quantiles over the surfaces of a population, at given Delta and at
given pressure.

Where no surrogate was trained on the mean gap, it follows from the force: it is (z_max - mean z) -
Delta plus the mean displacement. The latter is linear in the pressures and, for a given patch,
nearly F / (E* L) times a number that depends on the place of the load, and that comes from the
coarse contact solve.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bem.spacing import Boundary
from gen.law import Law, contact_law
from gen.law.contact_law import STEPS, law_of, solved_law, usual_loads
from gen.law.subjects import LawSurfaces, is_scene, read_subjects, scene_of
from gen.material import Bodies
from gen.runtime.errors import InputError
from learn.surrogate.law import predicted
from learn.surrogate.model import Surrogate


@dataclass(frozen=True)
class Order(contact_law.Order):
    """A request for a law of a surrogate.

    Attributes
    ----------
    solver : bool
        True to solve instead of predicting.

    E*, hardness, boundary and range of Delta are those of the training where they are not given.
    """

    solver: bool = False


def make(surrogate: Surrogate | None, order: Order, say: Callable[[str], None]) -> Law:
    """Make a law.

    Parameters
    ----------
    surrogate : Surrogate or None
        Surrogate that predicts. Where contacts are solved it may be None; otherwise its E*,
        hardness, boundary and range of Delta stand in for those that are not given.
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
    deltas, pressures = order.loads()
    boundary = _boundary(surrogate, order)
    subjects = read_subjects(order.inputs, order.surfaces, order.reading, boundary, say)
    left_out: list[str] = []
    if surrogate is not None and not order.solver:
        kept, left_out = predicted.defined(surrogate, subjects.surfaces)
        subjects = replace(subjects, surfaces=kept)
    bodies = _bodies(surrogate, order, subjects)
    if deltas is None and (pressures is None or not order.solver):
        if surrogate is None:
            deltas, pressures = usual_loads(subjects, bodies.e_star)
        else:
            low, high = surrogate.card["delta"]
            deltas = np.unique(np.linspace(float(low), float(high), STEPS))
    if order.solver:
        return solved_law(order, subjects, bodies, (deltas, pressures))
    assert surrogate is not None
    assert deltas is not None
    stiffness = order.stiffness or order.conductivities is not None
    tables = predicted.tables(
        surrogate, subjects.surfaces, deltas, pressures, order.level, bodies, stiffness=stiffness
    )
    tables = (*tables[:2], [*left_out, *tables[2]])
    said = f"predicted by {surrogate.card['title']}", f"{100 * order.level:g} % conformal interval"
    return law_of(order, subjects, bodies, tables, said)


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


def _bodies(surrogate: Surrogate | None, order: Order, subjects: LawSurfaces) -> Bodies:
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
