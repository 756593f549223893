"""Layers of bodies as features, and the layers that a training covers.

A layer adds a length and two moduli to a contact: its thickness, its modulus, and the modulus of
its base. The contact stays the same if the thickness is scaled with the lengths along the surface,
and all moduli are scaled together (`gen.quantities.OF_LAYERS`). The features are therefore two
ratios:

- the thickness times a wave number of the surface, because a wave of pressure reaches about as deep
  as it is long;
- the plane-strain modulus E* of the base over that of the layer.

Contacts also depend on both Poisson's ratios. These are no features, because all rows of a training
have equal ones: no scene draws them (`LayerKind`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

import bem
from gen.arrays import Values
from gen.distribution import limits
from gen.quantities import LAYER_MODULUS, LAYER_THICKNESS
from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from gen.scene import Scene

SAME = 1e-6
"""Two numbers of layers are equal if their relative difference is at most this rounding error."""

Span = tuple[float, float]
"""The smallest and the largest number of a training."""


@dataclass(frozen=True, eq=False)
class Layers:
    """The layers of n rows, without their Poisson's ratios.

    Attributes
    ----------
    thickness : ndarray, shape (n,), or float
        Thickness of the layers [um].
    e_star : ndarray, shape (n,), or float
        E* of the layers [MPa].
    base_e_star : ndarray, shape (n,), or float
        E* of their bases, infinite for rigid ones [MPa].
    """

    thickness: Values | float
    e_star: Values | float
    base_e_star: Values | float

    @classmethod
    def of_bodies(cls, bodies: Sequence[bem.Layered]) -> Self:
        """Return the layers of bodies.

        Parameters
        ----------
        bodies : sequence of bem.Layered
            A body for each of n rows, or one for all rows.

        Returns
        -------
        Layers
            The layers, with an array of one number for each body.
        """
        return cls(
            thickness=np.array([body.thickness for body in bodies]),
            e_star=np.array([body.e_star for body in bodies]),
            base_e_star=np.array([_base_e_star(body) for body in bodies]),
        )

    @classmethod
    def of_rows(cls, scene: Scene, column: Callable[[str], Values]) -> Self | None:
        """Return the layers of all rows of a database.

        Parameters
        ----------
        scene : Scene
            The scene of the database.
        column : callable
            Function that reads a column of the database, (n,), by its name.

        Returns
        -------
        Layers or None
            The layers of n rows; None if the scene has half-spaces.
        """
        contact = scene.contact
        # The smallest values of drawn numbers, which columns of the database replace below.
        body = contact.body({})
        if body is None or contact.layer is None:
            return None
        thickness: Values | float = body.thickness
        e_star: Values | float = body.e_star
        if LAYER_THICKNESS in contact.layer.drawn:
            thickness = column(LAYER_THICKNESS)
        if LAYER_MODULUS in contact.layer.drawn:
            e_star = column(LAYER_MODULUS) / (1 - body.poisson**2)
        return cls(thickness=thickness, e_star=e_star, base_e_star=_base_e_star(body))

    @property
    def base_ratio(self) -> Values | float:
        """E* of the base over E* of the layer, infinite for a rigid base [1]."""
        return self.base_e_star / self.e_star

    def repeated(self, number: int) -> Self:
        """Repeat numbers that all rows share.

        Parameters
        ----------
        number : int
            Number n of rows.

        Returns
        -------
        Layers
            The layers, with arrays of shape (n,).
        """
        return type(self)(
            thickness=np.broadcast_to(self.thickness, number),
            e_star=np.broadcast_to(self.e_star, number),
            base_e_star=np.broadcast_to(self.base_e_star, number),
        )


def joined_layers(parts: Sequence[Layers | None], sizes: Sequence[int]) -> Layers | None:
    """Join the layers of several parts of rows.

    Parameters
    ----------
    parts : sequence of Layers or None
        Layers of each part. They are None for all parts (half-spaces) or for no part.
    sizes : sequence of int
        Number of rows of each part.

    Returns
    -------
    Layers or None
        The layers of all rows, part by part; None for half-spaces.
    """
    repeated = [
        layers.repeated(size)
        for layers, size in zip(parts, sizes, strict=True)
        if layers is not None
    ]
    if not repeated:
        return None
    return Layers(
        thickness=np.concatenate([layers.thickness for layers in repeated]),
        e_star=np.concatenate([layers.e_star for layers in repeated]),
        base_e_star=np.concatenate([layers.base_e_star for layers in repeated]),
    )


def _base_e_star(body: bem.Layered) -> float:
    """Return E* of the base of a layer [MPa]; infinite for a rigid one."""
    if isinstance(body.base, bem.HalfSpace):
        return body.base.e_star
    return math.inf


@dataclass(frozen=True)
class LayerKind:
    """What all layers of a training have in common."""

    poisson: float  # Poisson's ratio of the layer
    base_poisson: float | None  # Poisson's ratio of the base; None if it is rigid

    @classmethod
    def of(cls, body: bem.Layered) -> Self:
        """Return the kind of the layer of a body.

        Parameters
        ----------
        body : bem.Layered
            The body.

        Returns
        -------
        LayerKind
            Poisson's ratios of the layer and of its base.
        """
        base_poisson: float | None = None
        if isinstance(body.base, bem.HalfSpace):
            base_poisson = body.base.poisson
        return cls(poisson=body.poisson, base_poisson=base_poisson)

    @property
    def text(self) -> str:
        """The kind in words, as "Poisson's ratio 0.3 on a rigid base"."""
        base = "a rigid base"
        if self.base_poisson is not None:
            base = f"a base of {self.base_poisson:.6g}"
        return f"Poisson's ratio {self.poisson:.6g} on {base}"


@dataclass(frozen=True)
class TrainedLayers:
    """The layers of the databases that a surrogate has learnt.

    Attributes
    ----------
    kind : LayerKind
        Poisson's ratios and kind of the base.
    thickness : tuple of float
        Smallest and largest thickness [um].
    modulus : tuple of float
        Smallest and largest Young's modulus of the layers [MPa].
    base_modulus : tuple of float or None
        Smallest and largest Young's modulus of the bases [MPa]; None for rigid ones.
    base_ratio : tuple of float or None
        Smallest and largest E* of the base over that of the layer [1]; None for rigid bases.
    """

    kind: LayerKind
    thickness: Span
    modulus: Span
    base_modulus: Span | None
    base_ratio: Span | None

    @classmethod
    def of_scenes(cls, scenes: Sequence[Scene]) -> Self | None:
        """Return the layers of scenes.

        Parameters
        ----------
        scenes : sequence of Scene
            Scenes of one kind of layers, or of half-spaces.

        Returns
        -------
        TrainedLayers or None
            The layers of all scenes; None for half-spaces.
        """
        thicknesses: list[float] = []
        moduli: list[float] = []
        base_moduli: list[float] = []
        ratios: list[float] = []
        kind: LayerKind | None = None
        for scene in scenes:
            layer = scene.contact.layer
            body = scene.contact.body({})
            if layer is None or body is None:
                continue
            kind = LayerKind.of(body)
            thicknesses += limits(layer.thickness)
            moduli += limits(layer.modulus)
            if isinstance(body.base, bem.HalfSpace):
                base_moduli.append(body.base.modulus)
                ratios += [
                    body.base.e_star / e_star for e_star in scene.contact.e_star_limits
                ]
        if kind is None:
            return None
        return cls(
            kind=kind,
            thickness=(min(thicknesses), max(thicknesses)),
            modulus=(min(moduli), max(moduli)),
            base_modulus=_span(base_moduli),
            base_ratio=_span(ratios),
        )

    @classmethod
    def of_card(cls, entry: Mapping[str, Any]) -> Self:
        """Return the layers that the card of a surrogate states.

        Parameters
        ----------
        entry : mapping of str to object
            The layers as the property `entry` writes them.

        Returns
        -------
        TrainedLayers
            The layers.

        Raises
        ------
        KeyError, TypeError, ValueError
            If the entry is malformed.
        """
        base_poisson = entry["base_poisson"]
        if base_poisson is not None:
            base_poisson = float(base_poisson)
        thinnest, thickest = entry["thickness"]
        softest, stiffest = entry["modulus"]
        return cls(
            kind=LayerKind(poisson=float(entry["poisson"]), base_poisson=base_poisson),
            thickness=(float(thinnest), float(thickest)),
            modulus=(float(softest), float(stiffest)),
            base_modulus=_span(entry["base_modulus"] or ()),
            base_ratio=_span(entry["base_ratio"] or ()),
        )

    @property
    def entry(self) -> dict[str, Any]:
        """The layers as an entry of a card, which JSON can hold."""
        spans: dict[str, Any] = {
            "thickness": list(self.thickness),
            "modulus": list(self.modulus),
            "base_modulus": None,
            "base_ratio": None,
        }
        if self.base_modulus is not None and self.base_ratio is not None:
            spans["base_modulus"] = list(self.base_modulus)
            spans["base_ratio"] = list(self.base_ratio)
        return {
            "poisson": self.kind.poisson,
            "base_poisson": self.kind.base_poisson,
            **spans,
        }

    @property
    def only(self) -> bem.Layered | None:
        """The body of all rows if they share one layer on one base, otherwise None."""
        spans = [self.thickness, self.modulus]
        if self.base_modulus is not None:
            spans.append(self.base_modulus)
        if any(low < high for low, high in spans):
            return None
        base: bem.HalfSpace | Literal["rigid"] = "rigid"
        if self.base_modulus is not None and self.kind.base_poisson is not None:
            base = bem.HalfSpace(self.base_modulus[0], self.kind.base_poisson)
        return bem.Layered(self.thickness[0], self.modulus[0], self.kind.poisson, base)

    @property
    def e_star(self) -> Span:
        """Smallest and largest E* of the layers [MPa]."""
        low, high = self.modulus
        plane_strain = 1 - self.kind.poisson**2
        return low / plane_strain, high / plane_strain

    @property
    def text(self) -> str:
        """The layers and their bases in words."""
        base = "a rigid base"
        if self.base_modulus is not None:
            base = (
                f"{span_text(self.base_modulus)} MPa"
                f" (Poisson's ratio {self.kind.base_poisson:.6g})"
            )
        return (
            f"{span_text(self.thickness)} um of {span_text(self.modulus)} MPa"
            f" (Poisson's ratio {self.kind.poisson:.6g}) on {base}"
        )

    def require_kind(self, body: bem.Layered) -> None:
        """Refuse a layer of another kind than that of the training.

        Parameters
        ----------
        body : bem.Layered
            A body of a prediction.

        Raises
        ------
        InputError
            If a Poisson's ratio differs from that of the training, or only one of both bases is
            rigid.
        """
        kind = LayerKind.of(body)
        if kind != self.kind:
            raise InputError(
                f"the layer has {kind.text}: the surrogate was trained on layers with"
                f" {self.kind.text}"
            )

    def require_only(self, body: bem.Layered) -> None:
        """Refuse another body than the only one of a training.

        Parameters
        ----------
        body : bem.Layered
            A body of a prediction, of the kind of the training, which has one layer on one base.

        Raises
        ------
        InputError
            If thickness or moduli differ by more than rounding from those of the training.
        """
        # The ends of each span of the training are equal.
        pairs = [(body.thickness, self.thickness[0]), (body.modulus, self.modulus[0])]
        if isinstance(body.base, bem.HalfSpace) and self.base_modulus is not None:
            pairs.append((body.base.modulus, self.base_modulus[0]))
        for number, trained_number in pairs:
            if not math.isclose(number, trained_number, rel_tol=SAME):
                raise InputError(
                    f"the surrogate holds for a layer of {self.text} alone: leave out the layer, or"
                    " fit one with --features dimensionless or hybrid"
                )


def _span(numbers: Sequence[float]) -> Span | None:
    """Return the smallest and the largest number; None if the sequence is empty."""
    if not numbers:
        return None
    return float(min(numbers)), float(max(numbers))


def span_text(span: Span) -> str:
    """Write a span for people.

    Parameters
    ----------
    span : tuple of float
        Smallest and largest number.

    Returns
    -------
    str
        As "2 to 8", or "5" if both are equal.
    """
    low, high = span
    if low == high:
        return f"{low:.6g}"
    return f"{low:.6g} to {high:.6g}"
