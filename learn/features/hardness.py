"""Hardness over E*: of a scene, and of the rows of its database."""

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


def hardness_ratios(scene: Scene, hardness: Values | None) -> Values | None:
    """Return the hardness over E* of rows, (n,), from their hardness [MPa]; None if elastic."""
    return None if hardness is None else np.asarray(hardness) / modulus(scene)
