"""Propose a scene whose surfaces are windows of measured maps."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gen.draft.loads import Loads, Material, choose_loads
from gen.draft.spikes import common_threshold
from gen.draft.survey import FORM, MapSurvey, Texture, survey, with_texture
from gen.draft.windows import SIZES, common_spacing, window_nodes
from gen.measured.settings import Preparation
from gen.runtime.errors import InputError
from gen.scans.library import Reading
from gen.scans.tiles import Tiling

LOADS_PER_WINDOW = 5
"""Loads of each window: a ladder of loads on one surface costs less than as many surfaces."""

OVERLAP = 4
"""Windows over the number that lie side by side: more would show the same heights again."""

WINDOWS = (200, 2000)
"""Smallest and largest number of windows."""


@dataclass(frozen=True)
class Proposal:
    """A scene of windows of maps, with the reasons for its values.

    Attributes
    ----------
    looks : tuple of MapSurvey
        All files; those without a fault are used.
    reading : Reading
        How files are read.
    preparation : Preparation
        Steps of the preparation.
    spacing : float or None
        Spacing to which all maps are resampled; None if they share theirs [um].
    nodes : int
        Nodes along each side of a window.
    windows : int
        Number of windows.
    loads : Loads
        Loads of the scene.
    material : Material
        Elastic constants and hardness.
    """

    looks: tuple[MapSurvey, ...]
    reading: Reading
    preparation: Preparation
    spacing: float | None
    nodes: int
    windows: int
    loads: Loads
    material: Material

    @property
    def used(self) -> list[MapSurvey]:
        """The maps that are used."""
        return [look for look in self.looks if not look.fault]

    @property
    def step(self) -> float:
        """Distance of the nodes of all windows, along x if it differs [um]."""
        return self.used[0].spacing[0] if self.spacing is None else self.spacing

    @property
    def length(self) -> float:
        """Autocorrelation length of a usual map [um]; NaN if it is unknown."""
        return _usual_length([known_texture(look) for look in self.used])

    @property
    def tiling(self) -> Tiling:
        """Tiles of the maps that are used."""
        shapes = tuple(known_texture(look).shape for look in self.used)
        return Tiling(shapes, (self.nodes, self.nodes))


def known_texture(look: MapSurvey) -> Texture:
    """Return the texture of a map that is used."""
    assert look.texture is not None  # maps without one have a fault
    return look.texture


def propose(
    paths: Sequence[Path],
    reading: Reading,
    material: Material,
    looked: Callable[[], None] = lambda: None,
) -> Proposal:
    """Look at maps twice, raw and prepared, and choose windows and loads.

    Parameters
    ----------
    paths : sequence of Path
        Files of maps.
    reading : Reading
        How they are read.
    material : Material
        Elastic constants and hardness.
    looked : callable
        Called whenever a file has been looked at, twice for each.

    Returns
    -------
    Proposal
        The scene.

    Raises
    ------
    InputError
        If no map can be used.
    """
    looks = survey(paths, reading, looked)
    require_used(looks)
    spacing = common_spacing([look.spacing for look in looks if not look.fault])
    looks = [_without_coarse(look, spacing) for look in looks]
    preparation = choose_preparation([look for look in looks if not look.fault])
    target = None if spacing is None else (spacing, spacing)
    for index, look in enumerate(looks):
        if not look.fault:
            looks[index] = with_texture(look, reading, preparation, target)
        looked()
    used = require_used(looks)
    textures = [known_texture(look) for look in used]
    step = max(used[0].spacing) if spacing is None else spacing
    nodes = window_nodes([each.shape for each in textures], _usual_length(textures) / step)
    if nodes is None:
        raise InputError(
            f"the maps are too small for windows: all have fewer than {SIZES[-1]} nodes a side"
        )
    looks = [_without_small(look, nodes) for look in looks]
    textures = [known_texture(look) for look in require_used(looks)]
    loads = choose_loads(material, [each.rms_slope for each in textures], nodes**2)
    windows = _windows([each.shape for each in textures], nodes)
    return Proposal(tuple(looks), reading, preparation, spacing, nodes, windows, loads, material)


def require_used(looks: Sequence[MapSurvey]) -> list[MapSurvey]:
    """Return the maps that can be used; refuse files of which none can."""
    used = [look for look in looks if not look.fault]
    if not used:
        others = f", and {len(looks) - 1} more files" if len(looks) > 1 else ""
        raise InputError(f"no map can be used: {looks[0].path}: {looks[0].fault}{others}")
    return used


def choose_preparation(looks: Sequence[MapSurvey]) -> Preparation:
    """Choose the steps of the preparation by the spikes, form and holes found in the maps."""
    spikes = [look.spikes for look in looks if look.spikes is not None]
    return Preparation(
        despike=common_threshold(spikes),
        level="quadratic" if any(look.form > FORM for look in looks) else "plane",
        fill=any(look.missing for look in looks),
    )


def _without_coarse(look: MapSurvey, spacing: float | None) -> MapSurvey:
    """Leave out a map that is coarser than the spacing of all."""
    if look.fault or spacing is None or max(look.spacing) <= 1.001 * spacing:
        return look
    fault = f"a node every {max(look.spacing):.4g} um, most others have one every {spacing:g}"
    return replace(look, fault=fault)


def _without_small(look: MapSurvey, nodes: int) -> MapSurvey:
    """Leave out a map that holds no window."""
    if look.fault or min(known_texture(look).shape) >= nodes:
        return look
    nx, ny = known_texture(look).shape
    return replace(look, fault=f"{nx} x {ny} nodes hold no window of {nodes} x {nodes}")


def _usual_length(textures: Sequence[Texture]) -> float:
    """Return the median of the autocorrelation lengths that are known [um]."""
    known = [each.length for each in textures if not math.isnan(each.length)]
    return statistics.median(known) if known else math.nan


def _windows(shapes: Sequence[tuple[int, int]], nodes: int) -> int:
    """Choose the number of windows, in tens."""
    beside = sum(math.prod(shape) for shape in shapes) / nodes**2
    return 10 * round(min(max(OVERLAP * beside, WINDOWS[0]), WINDOWS[1]) / 10)
