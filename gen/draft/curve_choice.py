"""Choose, of several populations that are fitted to maps, the one whose contact is the maps'."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gen.arrays import Heights, Values
from gen.draft.press import Press, pressures_for
from gen.material import Bodies
from gen.population import Population, generate_like
from gen.statistics import rms_slope

COMPARED = 3  # number of surfaces of each population that are pressed
# Largest number of pressed nodes of a surface. More surfaces tell more than finer ones.
MOST_NODES = 110_000
NAMES = ("area", "mean gap")  # answers that are compared
# Elastic bodies: a choice that does not depend on the bodies is part of the population.
BODIES = Bodies(e_star=1.0)


def nearest_population(
    populations: Sequence[Population], maps: Sequence[Heights]
) -> Population:
    """Choose the population whose area and mean gap under two pressures are nearest the maps'.

    Parameters
    ----------
    populations : sequence of Population
        At least one population, all at the spacing of the maps.
    maps : sequence of ndarray, shape (nx, ny)
        Heights of the maps, scaled to the rms height of the populations [um].

    Returns
    -------
    Population
        The nearest one; the first one of equally near ones.
    """
    if len(populations) == 1:
        return populations[0]
    shape = max((heights.shape for heights in maps), key=math.prod)
    spacing = populations[0].spacing
    slope = math.sqrt(np.mean([rms_slope(heights, spacing) ** 2 for heights in maps]))
    light, middle, _ = pressures_for(slope, BODIES)
    press = Press(
        spacing=spacing,
        step=math.ceil(math.sqrt(math.prod(shape) / MOST_NODES)),
        bodies=BODIES,
        pressures=(light, middle),
    )
    of_maps = _mean_answers(press, maps)
    distances = []
    for population in populations:
        surfaces = [
            generate_like(
                population, shape, shape, np.random.default_rng([COMPARED, seed])
            )
            for seed in range(COMPARED)
        ]
        distances.append(_distance(_mean_answers(press, surfaces), of_maps))
    return populations[int(np.argmin(distances))]


def _mean_answers(press: Press, surfaces: Sequence[Heights]) -> Values:
    """Return the means of answers over surfaces [um], shape (pressures, names).

    They are NaN where a contact has not converged.
    """
    of_surfaces = []
    for heights in surfaces:
        of_pressures = press.answers(heights, names=NAMES)
        of_surfaces.append([list(answers.values()) for answers in of_pressures])
    return np.asarray(np.mean(of_surfaces, axis=0))


def _distance(of_surfaces: Values, of_maps: Values) -> float:
    """Return the largest distance of logarithms of mean answers; infinity if one is not above 0."""
    if not ((of_surfaces > 0).all() and (of_maps > 0).all()):
        return math.inf
    return float(np.abs(np.log(of_surfaces / of_maps)).max())
