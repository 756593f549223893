"""Hardness over E*: of a scene, and of the rows of its database."""

from collections.abc import Sequence

import numpy as np

from gen.arrays import Values
from gen.material import plane_strain_modulus
from gen.scene import Scene
from learn.features.sets import Limits


def modulus(scene: Scene) -> float:
    """Return the E* of a scene [MPa]."""
    return plane_strain_modulus(scene.contact.modulus, scene.contact.poisson)


def hardness_limits(scene: Scene) -> Limits | None:
    """Return the smallest and largest hardness over E* of a scene; None for elastic bodies."""
    limits = scene.contact.hardness_limits
    return None if limits is None else (limits[0] / modulus(scene), limits[1] / modulus(scene))


def limits_of(scenes: Sequence[Scene]) -> Limits | None:
    """Return the smallest and largest hardness over E* of several scenes; None if all are elastic.

    Parameters
    ----------
    scenes : sequence of Scene
        The scenes, elastic ones among them.
    """
    given = [limits for scene in scenes if (limits := hardness_limits(scene)) is not None]
    return (min(low for low, _ in given), max(high for _, high in given)) if given else None


def are_mixed(scenes: Sequence[Scene]) -> bool:
    """Tell whether some scenes have elastic bodies and others have bodies that yield."""
    return len({hardness_limits(scene) is None for scene in scenes}) > 1


def hardness_ratios(scene: Scene, hardness: Values | None) -> Values | None:
    """Return the hardness over E* of rows, (n,), from their hardness [MPa]; None if elastic."""
    return None if hardness is None else np.asarray(hardness) / modulus(scene)
