"""A stage of conjugate gradients on some of the nodes, which ends when their set has to change."""

from collections.abc import Callable

import numpy as np

from bem.arrays import Nodes, Values
from bem.iterate import CONVOLUTION, ITERATION, Iterate, Operators, inner
from bem.vectors import add_scaled, largest_magnitude, scale_and_add, take


def run_stage(
    operators: Operators,
    iterate: Iterate,
    nodes: Nodes,
    correct: Callable[[Values], Values],
    has_to_change: Callable[[Values, float], bool],
    goals: tuple[float, float],
    max_iterations: int,
) -> None:
    """Solve loosely for the pressure that leaves no residual on some of the nodes.

    The set is checked whenever the residual has fallen by the first of the goals; a residual
    below the second ends the stage. The residual is updated on all nodes, because the convolution
    yields it there at no extra cost.

    Parameters
    ----------
    operators : Operators
        The influence matrix.
    iterate : Iterate
        Pressure and residual, improved in place.
    nodes : ndarray, shape (a,)
        Nodes whose pressure is asked for.
    correct : callable
        Preconditioner: (a,) residual -> (a,) correction of the pressure.
    has_to_change : callable
        Decides, from the (a,) pressure and its largest residual, whether to end the stage.
    goals : tuple of float
        Factor by which the residual falls between checks, and the residual that is small enough.
    max_iterations : int
        Bound on the iterations, including those that the iterate has taken already.
    """
    pressure, residual = take(iterate.pressure, nodes), take(iterate.residual, nodes)
    weights = pressure if operators.load is None else _weights(pressure)
    reduction, floor = goals
    largest = largest_magnitude(residual)
    goal = max(reduction * largest, floor)
    direction, previous = np.zeros(pressure.size), np.inf
    while iterate.effort.iterations < max_iterations and largest > floor:
        correction = correct(residual)
        product = inner(residual, correction)
        scale_and_add(direction, product / previous, correction)
        previous = product
        image = operators.image_of(nodes, direction)
        moved = image.on_nodes(correction)
        stiffness = inner(direction, moved)
        iterate.effort += CONVOLUTION
        if not (product > 0 and stiffness > 0):  # only rounding is left
            break
        step = product / stiffness
        add_scaled(pressure, step, direction)
        image.add_to(iterate.residual, -step)
        add_scaled(residual, -step, moved)
        iterate.effort += ITERATION
        if operators.load is not None:
            iterate.level(weights, residual)
            take(iterate.residual, nodes, residual)
        largest = largest_magnitude(residual)
        if largest > goal:
            continue
        if has_to_change(pressure, largest):
            break
        goal = max(reduction * goal, floor)
    iterate.pressure[nodes] = pressure


def _weights(pressure: Values) -> Values:
    """Return the weights of the mean residual under a load: the pressure, or one without any."""
    return pressure.copy() if pressure.any() else np.ones_like(pressure)
