"""Surfaces that a function of the user's makes."""

from collections.abc import Mapping

import numpy as np

from gen.arrays import Heights
from gen.runtime.errors import InputError, SourceError
from gen.runtime.user_code import faults_of, load_function
from gen.scene import PythonSurface, Scene


def surface_heights(
    scene: Scene, surface: int, parameters: Mapping[str, float], random: np.random.Generator
) -> Heights:
    """Call the function; parameters and result are those of `gen.populations.surface_heights`."""
    settings = scene.surface
    assert isinstance(settings, PythonSurface)
    if settings.source is None:  # only a file that was not made by a run lacks it
        raise SourceError(f"{settings.function}: the scene lacks the hash of its source")
    place = f"{settings.function}, surface {surface}"
    function = load_function(settings.function, settings.source)
    with faults_of(place):
        made = function(scene.shape, scene.spacing, random, **parameters)
        heights = np.asarray(made)
        if heights.dtype.kind not in "fiub":
            raise SourceError(f"{place}: returned {_kind(made)}, not heights [um]")
        heights = np.array(heights, dtype=np.float64)  # a copy: the function may keep its own
    if heights.shape != scene.shape:
        raise SourceError(f"{place}: heights are of shape {heights.shape}, not {scene.shape}")
    if not np.isfinite(heights).all():
        raise InputError(f"{place}: heights are not finite")
    heights -= heights.min()
    return heights


def _kind(value: object) -> str:
    """Return the type of a value in words."""
    return "nothing" if value is None else f"a {type(value).__name__}"
