"""Surfaces as commands name them: a file with its settings, alone or against a second one."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gen.measured.composite import Placement, composite
from gen.measured.preparation import prepare
from gen.measured.settings import Preparation
from gen.measured.topography import Topography, read
from gen.runtime.errors import InputError

if TYPE_CHECKING:  # surfaces are described without the solver
    from bem.spacing import Boundary


READING = ("side", "unit", "channel", "override_scale")
STEPS = (
    *("crop", "invert", "mask", "despike", "level", "form", "fill", "fill_most", "filter_"),
    "downsample",
)
"""Parameters of commands that say how a file is read, and how its map is prepared."""


@dataclass(frozen=True)
class Source:
    """A file with a surface, and how it is read and prepared.

    Attributes
    ----------
    path : Path
        The file.
    side, unit, channel, override_scale
        See `gen.measured.topography.read`.
    preparation : Preparation
        Steps from the measured map to the surface.
    """

    path: Path
    side: str = ""
    unit: str = ""
    channel: str = ""
    override_scale: bool = False
    preparation: Preparation = field(default_factory=Preparation)

    @classmethod
    def of_options(cls, path: Path, options: dict[str, Any]) -> Source:
        """Make a source of a command's options.

        Parameters
        ----------
        path : Path
            The file.
        options : dict
            Value of each option by the name of its parameter; other options are left out.
        """
        steps = {name.rstrip("_"): options[name] for name in STEPS}
        reading = {name: options[name] for name in READING}
        return cls(path, **reading, preparation=Preparation(**steps))

    def measured(self, boundary: Boundary) -> Topography:
        """Read the surface as a patch of a boundary; raise InputError if it cannot be read."""
        return read(
            self.path,
            self.side,
            self.unit,
            channel=self.channel,
            override_scale=self.override_scale,
            boundary=boundary,
        )


@dataclass(frozen=True)
class Opposite:
    """The second of two rough bodies.

    Attributes
    ----------
    source : Source
        Its surface.
    placement : Placement
        How it is laid on the first one.
    shared : bool
        Whether its settings are those of the first body: lengths and unit that its own file states
        then stand.
    """

    source: Source
    placement: Placement
    shared: bool = True

    def measured(self, boundary: Boundary) -> Topography:
        """Read the surface as a patch of a boundary; raise InputError if it cannot be read."""
        source = self.source
        try:
            return source.measured(boundary)
        except InputError:
            if self.shared and not source.override_scale and (source.side or source.unit):
                with suppress(InputError):
                    return replace(source, side="", unit="").measured(boundary)
            raise

    def prepared(self, boundary: Boundary) -> Topography:
        """Read and prepare the surface; raise InputError if that is not possible."""
        return prepare(self.measured(boundary), self.source.preparation)


def surface_of(source: Source, opposite: Opposite | None, boundary: Boundary) -> Topography:
    """Read and prepare a surface, or the composite surface of two bodies.

    Parameters
    ----------
    source : Source
        First or only body.
    opposite : Opposite or None
        Second body; None for a plane.
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patch.

    Returns
    -------
    Topography
        Prepared surface.

    Raises
    ------
    InputError
        If a file cannot be read or prepared, or the bodies share fewer than 2 x 2 nodes.
    """
    surface = prepare(source.measured(boundary), source.preparation)
    if opposite is None:
        return surface
    return composite(surface, opposite.prepared(boundary), opposite.placement)
