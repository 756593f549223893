"""Elastic contact of a patch without edges under a load: the method that suits its share of nodes.

Dense algebra solves contacts of few nodes or few gaps, and sparse algebra those of more gaps.
Between them, projected steps and conjugate gradients, on lists of nodes while these are a small
share and else on whole fields, start from coarser cells, on the highest nodes, or from the pressure
of full contact.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from bem.arrays import Field
from bem.edgeless_patch import Patch
from bem.equilibrium import Start
from bem.interface import few_nodes
from bem.iterate import Effort, Iterate
from bem.listed_contact import OnLists
from bem.nearly_full import press_nearly_full
from bem.under_load import APPROACH, APPROACH_FROM_FULL, OnFields, Steps, approach, press_under_load
from bem.whole_patch import Pressed, WholePatch, touching_nodes

# Finds a start on coarser cells, or none, and the work that this took.
Coarser = Callable[[], tuple[Start | None, Effort]]

# Share of the largest set that is worth factorising for which no further step is taken before, and
# the violation, over the displacement, from which none is taken for larger ones: a set that lacks
# nodes is factorised twice.
VERY_FEW, NEARLY = 0.4, 0.06

# Share of nodes in contact up to which lists of them take less time than whole fields.
LISTED = 0.22

# Mean pressure, over E* times the rms slope, up to which a start on the highest nodes is nearer to
# the solution than one from full contact, and the share of nodes that it takes, over this pressure.
LIGHT, PEAKS = 0.1, 8.0

# The same mean pressure from which a contact may be full or nearly so; and the distance of the rows
# and columns that tell the slope. The pressure of full contact varies by half of the slope.
FLAT, SAMPLED = 0.6, 16


def press_elastic(
    patch: Patch, load: float, start: Iterate | None, rtol: float, coarser: Coarser | None
) -> tuple[Iterate, bool]:
    """Solve under a load as if the bodies did not yield.

    Parameters
    ----------
    patch : Patch
        The problem.
    load : float
        Sum of the pressure, above 0 [reduced].
    start : Iterate or None
        A pressure to start from.
    rtol : float
        Largest violation accepted, over the displacement [1].
    coarser : callable or None
        Finds a start on coarser cells where none is given; None if that gains nothing.

    Returns
    -------
    iterate : Iterate
        The solution, or the best that was found; its shift is the displacement.
    converged : bool
        Whether the tolerance is met.
    """
    problem, shape = patch.problem, patch.problem.heights.shape
    whole = WholePatch(
        patch.below.reshape(shape),
        problem.boundary,
        problem.aspect,
        load,
        keep_displacement=patch.keep_displacement,
    )
    if start is None:
        pressed = _first(patch, whole, rtol, coarser)
    else:
        residual = start.residual.reshape(shape).astype(np.float32)
        pressed = Pressed(start.pressure.reshape(shape), residual, start.shift, start.effort)
    share = APPROACH_FROM_FULL if start is None and coarser is None else APPROACH
    converged = pressed.converged or _settled(patch, whole, pressed, rtol, share)
    if patch.keep_displacement:
        patch.operators.field = whole.displacement
    iterate = _listed(pressed)
    iterate.exact = converged
    return iterate, converged


def _settled(patch: Patch, whole: WholePatch, pressed: Pressed, rtol: float, share: float) -> bool:
    """Improve a start under a load; return whether the tolerance is met.

    Projected steps on whole fields add a share of the preconditioned residual.
    """
    steps: Steps
    few, most = few_nodes(whole.below.size), patch.problem.max_iterations
    if touching_nodes(pressed) > max(LISTED * whole.below.size, few):
        steps = OnFields(whole, pressed, share)
    else:
        steps = listed = OnLists(whole, pressed)
        if patch.problem.hardness is None:
            approach(steps, partial(_few_enough, listed, few))
            listed.factorise(few, most - pressed.effort.iterations, rtol)
    approach(steps)
    return press_under_load(steps, rtol=rtol, least=1e-3 * patch.depth, max_iterations=most)


def _few_enough(steps: OnLists, few: int, violation: float) -> bool:
    """Return whether a contact set is small enough for dense algebra, and nearly the right one."""
    touching = steps.touching()
    return touching <= VERY_FEW * few or (violation <= NEARLY and touching <= few)


def _listed(pressed: Pressed) -> Iterate:
    """Return a pressure on the whole patch as one on the list of all nodes."""
    residual = pressed.residual.reshape(-1).astype(np.float64)
    return Iterate(pressed.pressure.reshape(-1), residual, pressed.effort, shift=pressed.shift)


def _first(patch: Patch, whole: WholePatch, rtol: float, coarser: Coarser | None) -> Pressed:
    """Start a solve under a load: the solution itself where the contact is full, or nearly so."""
    full, pressed, spent = None, None, Effort()
    load = _relative_load(patch, whole.load)
    if coarser is None and load <= LIGHT:
        return whole.start_on_peaks(PEAKS * load)
    if coarser is None or load >= FLAT:
        full = whole.full_contact()
        pressed = _closed(patch, whole, full, rtol)
    if pressed is None and coarser is not None:
        near, spent = coarser()
        if near is not None:
            return whole.begin(near.pressure, spent)
    if full is None:
        full = whole.full_contact()
        pressed = _closed(patch, whole, full, rtol)
    if pressed is None:
        pressed = whole.start(full)
    pressed.effort += spent
    return pressed


def _closed(patch: Patch, whole: WholePatch, full: Field, rtol: float) -> Pressed | None:
    """Return the solution if the contact is full, or nearly so if the bodies stay elastic."""
    if full.min() >= 0:
        return whole.closed(full)
    if patch.problem.hardness is not None:
        return None
    pressed = press_nearly_full(whole, full, rtol * patch.depth / 4)
    if pressed is not None:
        pressed.converged = pressed.violation() <= rtol * pressed.shift
    return pressed


def _relative_load(patch: Patch, load: float) -> float:
    """Return the mean pressure over E* times the rms slope of some rows and columns [1]."""
    heights = patch.below.reshape(patch.problem.heights.shape)
    along, across = np.diff(heights[:, ::SAMPLED], axis=0), np.diff(heights[::SAMPLED], axis=1)
    rows, columns = (float((d * d).sum()) / max(d.size, 1) for d in (along, across))
    slope = math.sqrt(rows + columns / patch.problem.aspect**2)
    return load / heights.size / slope if slope > 0 else math.inf
