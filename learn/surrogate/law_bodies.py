"""The bodies of a law that a surrogate predicts: E*, hardness and layer."""

from collections.abc import Mapping

import bem
from gen.law import Order
from gen.law.surfaces import LawSurfaces
from gen.material import Bodies
from gen.quantities import OF_LAYERS
from gen.scene import Scene
from learn.surrogate.model import Surrogate, under_a_rigid_body


def bodies_of_surfaces(
    surrogate: Surrogate, order: Order, law_surfaces: LawSurfaces
) -> Bodies:
    """Return the bodies of a law of surfaces.

    E* is that of the order, or else of the training. The hardness is that of the order, or else of
    the scenes, or else of the training. So is the layer, which has E*.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate of surfaces.
    order : Order
        The request for the law.
    law_surfaces : LawSurfaces
        Surfaces of the law.

    Returns
    -------
    Bodies
        The bodies [MPa].

    Raises
    ------
    InputError
        If the surrogate cannot predict these bodies, or the scenes draw or differ in their layers.
    """
    layered = order.layered
    if layered is None and order.e_star is None:
        layered = law_surfaces.layered_body()
    e_star = order.e_star
    modulus = order.e_star or surrogate.modulus
    body: bem.Layered | None = None
    if layered is not None:
        e_star = None  # the layer has it
        modulus = layered.e_star
        body = under_a_rigid_body(layered)
    hardness = order.hardness
    if hardness is None:
        ratio = law_surfaces.hardness_ratio()
        if ratio is not None:
            hardness = ratio * modulus
    return surrogate.bodies(e_star, hardness, body)


def bodies_of_parameters(surrogate: Surrogate, numbers: Mapping[str, float]) -> Bodies:
    """Return the bodies of a law of new surfaces of a scene.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate of a scene's own features.
    numbers : mapping of str to float
        Parameters of the scene. They have the hardness as "hardness" [MPa] or "hardness_ratio"
        (over E*), and the thickness [um] and the modulus [MPa] of a layer, if these are features.
        Otherwise the hardness is the smallest one of the training, usually its only one, and the
        layer that of the scene.

    Returns
    -------
    Bodies
        The bodies [MPa], whose E* is that of the scene or of the layer.
    """
    scene = Scene.from_text(str(surrogate.card["scene"]))
    of_layer = {name: numbers[name] for name in OF_LAYERS if name in numbers}
    layered = scene.contact.layered_body(of_layer)
    e_star = surrogate.modulus
    if layered is not None:
        e_star = layered.e_star
    return Bodies(
        e_star=e_star,
        hardness=_hardness(surrogate, numbers, e_star),
        has_modulus=True,  # The scene fixes E*.
        layered=layered,
    )


def _hardness(
    surrogate: Surrogate, numbers: Mapping[str, float], e_star: float
) -> float | None:
    """Return the hardness of a scene's contacts [MPa]; None for elastic bodies.

    `numbers` are those of `bodies_of_parameters`, and `e_star` is E* of the bodies [MPa].
    """
    if "hardness" in numbers:
        return numbers["hardness"]
    limits = surrogate.hardness_limits  # over E*
    if limits is None:
        return None
    ratio = numbers.get("hardness_ratio", limits[0])
    return ratio * e_star
