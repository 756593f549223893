"""The points of a law from the predictions of a surrogate for a patch under loads.

A surrogate predicts area and force at Deltas, or area and Delta at nominal pressures. Pressure,
closure and Delta of the law follow from these, and a mean gap that was not learnt from the force
and coarse contact solves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bem.derived.stiffness import without_patch
from gen.arrays import Values
from gen.law.curves import Points
from gen.law.order import Load
from gen.law.surfaces import LawSurface
from gen.material import Bodies
from gen.quantities import (
    ALSO,
    AREA,
    CLOSURE,
    DELTA,
    FORCE,
    MEAN_GAP,
    PRESSURE,
    STIFFNESS,
    UNLOADING,
)
from learn.features import SurfaceFeatures
from learn.surrogate.model import Prediction


@dataclass(frozen=True, eq=False)
class LoadedPatch:
    """A patch under k loads."""

    patch: LawSurface
    bodies: Bodies  # E* and hardness [MPa]
    kind: Load  # kind of the loads, for which the surrogate predicts
    loads: Values  # (k,), ascending and above 0, Deltas [um] or nominal pressures [MPa]
    # The surface of the patch, from which a mean gap follows that was not learnt; None if the
    # surrogate predicts from the numbers of a scene.
    surface: SurfaceFeatures | None = None
    # Compliance of the patch under a flat punch that fills it [um / MPa]; set by `__post_init__`.
    # Without edges it is 0, or the mean compliance of a layer on a rigid base.
    patch_compliance: float = field(init=False)

    def __post_init__(self) -> None:
        """Set the compliance of the patch."""
        patch_compliance = self.patch.patch_compliance(self.bodies)
        # The class is frozen, so that an ordinary assignment would be refused.
        object.__setattr__(self, "patch_compliance", patch_compliance)


def points_of(loaded: LoadedPatch, answer: Prediction, also: Sequence[str]) -> Points:
    """Turn the predictions for a patch under loads into points of its law.

    Parameters
    ----------
    loaded : LoadedPatch
        The patch and its k loads.
    answer : Prediction
        Predictions with intervals at these loads: area, and force at Deltas or Delta at pressures.
    also : sequence of str
        Names of further quantities of the law, keys of `ALSO`, all predicted.

    Returns
    -------
    Points
        Points under the k loads. The load, the force at a pressure, and the closure at a Delta have
        no intervals. There is a mean gap if it is predicted, or if it follows from coarse contact
        solves, and a stiffness if it is predicted.

    Raises
    ------
    InputError
        If a coarse contact solve fails.
    """
    # A mean gap that is not predicted follows from the force and from coarse contacts.
    means: CoarseMeans | None = None
    needs_means = loaded.kind == "delta" and MEAN_GAP.name not in answer.values
    has_means = has_mean_gap(loaded.patch, loaded.bodies)
    if needs_means and has_means and loaded.surface is not None:
        means = _coarse_means(loaded.surface, loaded.loads, loaded.bodies)
    values = _quantities(loaded, answer.values, means, also)
    low = _quantities(loaded, answer.low, means, also)
    high = _quantities(loaded, answer.high, means, also)
    # A given pressure is exact, and so is the force: the pressure times the nominal area.
    without_interval = (PRESSURE, FORCE)
    if loaded.kind == "delta":
        # A given Delta is exact. The closure falls with the force: its ends would be exchanged.
        without_interval = (DELTA, CLOSURE)
    for quantity in without_interval:
        del low[quantity.in_laws]
        del high[quantity.in_laws]
    return Points(values=values, low=low, high=high, reasons=answer.reasons)


def has_mean_gap(patch: LawSurface, bodies: Bodies) -> bool:
    """Return whether a mean gap that was not learnt follows from the force.

    The coarse contact solves are those of half-spaces. On layers they are only used where they do
    not matter: elastic bodies on a patch without edges have a mean displacement that is known.

    Parameters
    ----------
    patch : LawSurface
        The patch.
    bodies : Bodies
        The bodies.

    Returns
    -------
    bool
        True for half-spaces, and for elastic layered bodies on a patch without edges.
    """
    if bodies.layered is None:
        return True
    return patch.boundary != "free" and bodies.hardness is None


@dataclass(frozen=True, eq=False)
class CoarseMeans:
    """Means over the patch of coarse contact solves at k Deltas."""

    # (k,), mean gap if the bodies approached by Delta without deformation; may be negative [um]
    gap: Values
    relative_compliance: Values  # (k,), mean displacement over F / (E* L) [1]
    yielded_depth: Values  # (k,), mean depth by which nodes have yielded [um]
    length: float  # scan length L [um]


def _coarse_means(
    surface: SurfaceFeatures, deltas: Values, bodies: Bodies
) -> CoarseMeans:
    """Solve the coarse contacts of a surface at Deltas, (k,) [um], and return their means.

    Raises InputError if a coarse solve fails.
    """
    height_of_peak = float(surface.heights.max()) - float(surface.heights.mean())
    means = [surface.means(float(delta), bodies.hardness_ratio) for delta in deltas]
    return CoarseMeans(
        gap=height_of_peak - deltas,
        relative_compliance=np.array([mean.compliance for mean in means]),
        yielded_depth=np.array([mean.yielded_depth for mean in means]),
        length=surface.length,
    )


def _quantities(
    loaded: LoadedPatch,
    targets: Mapping[str, Values],
    means: CoarseMeans | None,
    also: Sequence[str],
) -> dict[str, Values]:
    """Return the quantities of a law at k loads, (k,) each, by their names in laws.

    `targets` are the predictions of a surrogate, or one end of their intervals, by target, (k,)
    each. A mean gap that was not learnt follows from `means`, which are given for Deltas only; if
    they are None, it is left out. `also` are the names of further targets that become quantities.
    """
    if loaded.kind == "delta":
        quantities = _quantities_at_deltas(loaded, targets)
    else:
        quantities = _quantities_at_pressures(loaded, targets)
    if MEAN_GAP.name in targets:
        quantities[MEAN_GAP.in_laws] = targets[MEAN_GAP.name]
    elif means is not None:
        quantities[MEAN_GAP.in_laws] = _mean_gap(loaded, targets["force"], means)
    # A law has the stiffness of the interface per area. A learnt stiffness of unloading is that of
    # the contact with its patch, whose compliance is taken out.
    nominal = loaded.patch.nominal
    if STIFFNESS.name in targets:
        quantities[STIFFNESS.in_laws] = targets[STIFFNESS.name] / nominal
    elif UNLOADING.name in targets:
        of_contact = targets[UNLOADING.name] / nominal
        quantities[STIFFNESS.in_laws] = of_interface(of_contact, loaded.patch_compliance)
    for name in also:
        quantities[ALSO[name].in_laws] = targets[name]
    return quantities


def _mean_gap(loaded: LoadedPatch, force: Values, means: CoarseMeans) -> Values:
    """Return the mean gaps at k Deltas that follow from forces, (k,) [um].

    The mean gap is that without deformation, plus the mean displacement and the mean yielded depth.
    A negative one becomes 0. The forces, (k,), are in uN.
    """
    force_over_e_star = force / loaded.bodies.e_star  # [um2]
    displacement = means.relative_compliance * force_over_e_star / means.length
    if loaded.patch.boundary != "free":
        # The coarse means are those of half-spaces. On a layer, the mean pressure displaces the
        # whole patch, too.
        pressure = force / loaded.patch.nominal
        displacement = displacement + loaded.patch_compliance * pressure
    return np.maximum(means.gap + displacement + means.yielded_depth, 0.0)


def _quantities_at_deltas(
    loaded: LoadedPatch, targets: Mapping[str, Values]
) -> dict[str, Values]:
    """Return area, pressure, closure, Delta and force at k Deltas, (k,) each, by names in laws.

    `targets` have area and force. A negative closure becomes 0.
    """
    deltas = loaded.loads
    pressure = targets["force"] / loaded.patch.nominal
    closure = deltas - loaded.patch_compliance * pressure
    return {
        AREA.in_laws: targets["area"],
        PRESSURE.in_laws: pressure,
        CLOSURE.in_laws: np.maximum(closure, 0.0),
        DELTA.in_laws: deltas,
        FORCE.in_laws: targets["force"],
    }


def _quantities_at_pressures(
    loaded: LoadedPatch, targets: Mapping[str, Values]
) -> dict[str, Values]:
    """Return area, pressure, closure, Delta and force at k pressures, (k,) each, by names in laws.

    `targets` have area and Delta. The closure is Delta less the displacement of the patch, but not
    negative, and raised where it falls with the pressure. Delta is then computed anew from it.
    """
    pressure = loaded.loads
    of_patch = loaded.patch_compliance * pressure
    closure = np.maximum.accumulate(np.maximum(targets["delta"] - of_patch, 0.0))
    return {
        AREA.in_laws: targets["area"],
        PRESSURE.in_laws: pressure,
        CLOSURE.in_laws: closure,
        DELTA.in_laws: closure + of_patch,
        FORCE.in_laws: pressure * loaded.patch.nominal,
    }


def of_interface(stiffness: Values, compliance: float) -> Values:
    """Take the compliance of the patch out of stiffnesses of a contact.

    Parameters
    ----------
    stiffness : ndarray, shape (k,)
        Stiffnesses of the contact with its patch, per nominal area [MPa / um].
    compliance : float
        Compliance of the patch [um / MPa]; 0 if it has no edges.

    Returns
    -------
    ndarray, shape (k,)
        Stiffnesses of the interface alone [MPa / um]; 0 without contact, and infinite where the
        contact is as stiff as the patch but for rounding.
    """
    if not compliance:
        return np.array(stiffness)
    return np.array([without_patch(value, 1 / compliance) for value in stiffness])
