"""The uniform compression of a layer: left to the mesh, or part of the closure of a law.

A uniform pressure p compresses a layer of thickness h by p h (1 + nu) (1 - 2 nu) / ((1 - nu) E), on
any base. A finite-element model whose mesh contains the layer computes this compression itself. The
closure of its law therefore excludes the compression, as it excludes the deformation of all bodies.
A thin coating is often left out of the mesh. Then its law has to include the compression: the
closure is larger by the compression, because the interface is in series with the layer.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bem.problem import Boundary, node_spacing
from gen.arrays import Values
from gen.law.curves import Points
from gen.law.order import Order
from gen.material import Bodies
from gen.options import NOT_WITH_LAYER
from gen.quantities import CLOSURE, PRESSURE, STIFFNESS
from gen.runtime.errors import InputError


def compliance_in_law(order: Order, bodies: Bodies) -> float:
    """Return the compliance of the layer if the closure of a law includes its compression.

    With a compliance above 0 the closure rises in full contact, too, so that tables of the law
    continue there.

    Parameters
    ----------
    order : Order
        The request for the law.
    bodies : Bodies
        Bodies of the law.

    Returns
    -------
    float
        Compression by a uniform pressure [um / MPa]; 0 for half-spaces, for incompressible layers,
        and if the mesh contains the layer.
    """
    if bodies.layered is None or order.layer_in == "mesh":
        return 0.0
    return bodies.layered.layer_compliance


def with_compression(points: Points, compliance: float) -> Points:
    """Put the layer in series with the interface: add its compression to the closure.

    Parameters
    ----------
    points : Points
        Points of one surface with pressure and closure, without the compression.
    compliance : float
        Compression of the layer by a uniform pressure [um / MPa]; 0 to leave the points unchanged.

    Returns
    -------
    Points
        The points with larger closures and, if they have stiffnesses, smaller stiffnesses. The low
        ends of intervals are changed by the compression at the low end of the pressure, and the
        high ends by that at its high end.
    """
    if compliance == 0:
        return points
    pressure = points.values[PRESSURE.in_laws]
    low_pressure = points.low.get(PRESSURE.in_laws, pressure)
    high_pressure = points.high.get(PRESSURE.in_laws, pressure)
    return replace(
        points,
        values=in_series(points.values, pressure, compliance),
        low=in_series(points.low, low_pressure, compliance),
        high=in_series(points.high, high_pressure, compliance),
    )


def in_series(
    curves: Mapping[str, Values], pressure: Values, compliance: float
) -> dict[str, Values]:
    """Put a layer in series with interfaces.

    Parameters
    ----------
    curves : mapping of str to ndarray, shape (k,)
        Quantities by their names in laws. Closure and stiffness are without the layer, and may be
        missing.
    pressure : ndarray, shape (k,)
        Nominal pressures [MPa].
    compliance : float
        Compression of the layer by a uniform pressure, above 0 [um / MPa].

    Returns
    -------
    dict of str to ndarray, shape (k,)
        All quantities, changed only in closure and stiffness, which are those of interface and
        layer together.
    """
    changed = dict(curves)
    if CLOSURE.in_laws in curves:
        changed[CLOSURE.in_laws] = curves[CLOSURE.in_laws] + compliance * pressure
    if STIFFNESS.in_laws in curves:
        # 1 / (1 / s + c); the stiffness s is 0 at first touch, and infinite in full contact.
        with np.errstate(divide="ignore"):
            of_interface = 1 / curves[STIFFNESS.in_laws]
        changed[STIFFNESS.in_laws] = 1 / (of_interface + compliance)
    return changed


def resolves_layer(
    bodies: Bodies,
    nodes: tuple[int, int],
    sides: tuple[float, float],
    boundary: Boundary,
) -> bool:
    """Return whether the cells of a grid are smaller than the layer.

    If they are, the material of the layer alone decides the pressure at the border of contact. The
    error of the grid is known only then.

    Parameters
    ----------
    bodies : Bodies
        Bodies of the law.
    nodes : tuple of int
        Nodes (nx, ny) of the grid.
    sides : tuple of float
        Sides of the patch [um].
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patch.

    Returns
    -------
    bool
        True if the cells are smaller than the layer, and for half-spaces.
    """
    if bodies.layered is None:
        return True
    spacing = (
        node_spacing(nodes[0], sides[0], boundary),
        node_spacing(nodes[1], sides[1], boundary),
    )
    return bodies.layered.body.is_deeper_than_cells(spacing)


def layer_in_words(order: Order, bodies: Bodies) -> list[str]:
    """Say whether the closure of a law contains the compression of the layer.

    Parameters
    ----------
    order : Order
        The request for the law.
    bodies : Bodies
        Bodies of the law.

    Returns
    -------
    list of str
        One line about the compression; empty for half-spaces.
    """
    if bodies.layered is None:
        return []
    compliance = bodies.layered.layer_compliance
    if compliance == 0:
        return ["the layer is incompressible: a uniform pressure does not compress it"]
    if order.layer_in == "law":
        line = (
            f"the closure has the layer's uniform compression, {compliance:.4g} um/MPa: leave the"
            " layer out of the mesh, which would count it twice"
        )
    else:
        line = (
            f"the closure is without the layer's uniform compression, {compliance:.4g} um/MPa: mesh"
            " the layer, or have it in the closure by --layer-in law"
        )
    return [line]


def check_layer(order: Order, bodies: Bodies) -> None:
    """Refuse conductances and shear of bodies with a layer, and `--layer-in law` without a layer.

    Parameters
    ----------
    order : Order
        The request for the law.
    bodies : Bodies
        Bodies of the law.

    Raises
    ------
    InputError
        If the bodies have a layer and the order asks for conductances or shear. Also if the bodies
        have no layer and the order includes one in the law.
    """
    if bodies.layered is None:
        if order.layer_in == "law":
            raise InputError(
                "--layer-in law: there is no layer: give --layer-thickness, or a scene with a table"
                " [contact.layer]"
            )
        return
    requested = {"conductivity": order.conductivities, "friction": order.friction}
    for name, value in requested.items():
        if value is not None:
            raise InputError(
                f"--{name}: leave it out with a layer: {NOT_WITH_LAYER[name].reason}"
            )
