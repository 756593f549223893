"""What shear does to an interface under a constant normal load: stiffness, shift and loss.

Bodies of like elastic constants stick at first and then slip from the border of the spots inwards,
until they slide at friction times the normal load. On a free patch all answers are those of the
interface alone, without the half-space behind the patch. See `bem.derived.slip`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bem import Contact, PartialSlip
    from gen.material import Friction

SHARES = (0.2, 0.4, 0.6, 0.8)
"""Shear forces at which laws have the shift and the loss, over the force at which bodies slide."""


@dataclass(frozen=True)
class SlipPoint:
    """The answers of a sheared interface at one shear force."""

    share: float  # shear force over the force at which the bodies slide
    shear: float  # shear force [uN]
    shift: float  # tangential displacement of the interface [um]
    stiffness: float  # slope of the shear force over the shift [N/m]
    stick_percent: float  # area that sticks, of the whole patch [%]
    loss: float  # of a cycle between both signs of the shear force [pJ]


@dataclass(frozen=True, eq=False)
class Sheared:
    """A contact that is sheared along one axis."""

    contact: Contact
    friction: Friction
    axis: int  # 0 for shear along x, 1 for shear along y

    @property
    def interface_stiffness(self) -> float:
        """Stiffness of the interface where nothing slips [N/m], infinite in full contact."""
        if self.contact.contact_nodes == self.contact.pressure.size:
            return math.inf
        return self._without_patch(self._stiffness)

    @property
    def elastic_slip(self) -> float:
        """Friction times the normal force over the stiffness of the interface [um].

        It is 0 for bodies apart and in full contact.
        """
        stiffness = self.interface_stiffness
        if stiffness == 0:  # bodies apart
            return 0.0
        return self._sliding / stiffness

    def shift(self, share: float) -> float:
        """Return the shift of the interface at one of `SHARES`.

        Parameters
        ----------
        share : float
            Shear force over the force at which the bodies slide, one of `SHARES`.

        Returns
        -------
        float
            Shift [um]: 0 for bodies apart and in full contact without edges. A free patch may slip
            in full contact, too.
        """
        if self._is_without_interface:
            return 0.0
        slip = _slip_along_x(self.contact, self.friction)
        return self._shift_of_interface(slip, SHARES.index(share), self._scale)

    def loss(self, share: float) -> float:
        """Return the loss of a cycle up to one of `SHARES`.

        Parameters
        ----------
        share : float
            Largest shear force over the force at which the bodies slide, one of `SHARES`.

        Returns
        -------
        float
            Loss [pJ]: 0 for bodies apart and in full contact without edges. A free patch may slip
            in full contact, too.
        """
        if self._is_without_interface:
            return 0.0
        slip = _slip_along_x(self.contact, self.friction)
        return self._scale * float(slip.loss[SHARES.index(share)])

    def curve(self, shares: Sequence[float]) -> list[SlipPoint]:
        """Return the answers at shares of the force at which the bodies slide.

        Parameters
        ----------
        shares : sequence of float
            Shares, from 0 to below 1.

        Returns
        -------
        list of SlipPoint
            A point for each share.

        Raises
        ------
        ValueError
            If a share is not allowed, or the contact is full and has no edges.
        ArithmeticError
            If a linear solve does not converge.
        """
        from bem import partial_slip

        slip = partial_slip(
            self.contact,
            self.friction.coefficient,
            [share * self._sliding for share in shares],
            poisson=self.friction.poisson,
            axis=self.axis,
        )
        stiffnesses = [self._without_patch(value) for value in slip.stiffness.tolist()]
        return [
            SlipPoint(
                share=share,
                shear=float(slip.shears[place]),
                # The slip is already that along this axis.
                shift=self._shift_of_interface(slip, place, scale=1.0),
                stiffness=stiffnesses[place],
                stick_percent=float(slip.stick_percent[place]),
                loss=float(slip.loss[place]),
            )
            for place, share in enumerate(shares)
        ]

    @property
    def _sliding(self) -> float:
        """Shear force at which the bodies slide [uN]."""
        return self.friction.coefficient * self.contact.force

    @property
    def _is_without_interface(self) -> bool:
        """Whether the bodies are apart, or in full contact without edges."""
        return self.contact.force == 0 or math.isinf(self.contact.stiffness)

    @property
    def _stiffness(self) -> float:
        """Stiffness in shear of patch and interface together [N/m]."""
        return _patch_and_interface(self.contact, self.friction.poisson, self.axis)

    @property
    def _scale(self) -> float:
        """Compliance of patch and interface along the axis over that along x [1]."""
        along_x = _patch_and_interface(self.contact, self.friction.poisson, 0)
        return along_x / self._stiffness

    @property
    def _patch(self) -> float:
        """Stiffness in shear of the half-space behind a free patch [N/m], infinite for others."""
        from bem.derived.slip import shear_patch_stiffness

        problem = self.contact.problem
        if problem.boundary != "free":
            return math.inf
        return shear_patch_stiffness(problem, self.friction.poisson, self.axis)

    def _without_patch(self, stiffness: float) -> float:
        """Return the stiffness of the interface from that of patch and interface [N/m]."""
        from bem.derived.stiffness import without_patch

        patch = self._patch
        if math.isinf(patch):
            return stiffness
        return without_patch(stiffness, patch)

    def _shift_of_interface(self, slip: PartialSlip, place: int, scale: float) -> float:
        """Return the shift of the interface at one of the forces of a slip [um].

        `scale` is the compliance along this axis over that along the axis of the slip. A shift that
        rounding has made negative is replaced by 0.
        """
        of_patch = slip.shears[place] / self._patch
        return max(float(scale * slip.shift[place] - of_patch), 0.0)


@lru_cache(maxsize=4)
def _slip_along_x(contact: Contact, friction: Friction) -> PartialSlip:
    """Shear a contact along x by `SHARES` of the force at which the bodies slide.

    The same area sticks along y, so that its answers follow from these by a factor. The answer is
    kept for further quantities of the contact.
    """
    from bem import partial_slip

    sliding = friction.coefficient * contact.force
    shears = [share * sliding for share in SHARES]
    return partial_slip(contact, friction.coefficient, shears, poisson=friction.poisson)


@lru_cache(maxsize=8)
def _patch_and_interface(contact: Contact, poisson: float, axis: int) -> float:
    """Return the stiffness of patch and interface [N/m], infinite in full contact without edges.

    The answer is kept for further quantities of the contact.
    """
    from bem.derived.slip import shear_stiffness

    if math.isinf(contact.stiffness):
        return math.inf
    return shear_stiffness(contact, poisson, axis)
