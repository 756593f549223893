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

    The order gives hardness and layer. If it gives no hardness, the scenes of the surfaces give it;
    if it gives neither a layer nor E*, they give the layer. The training completes the bodies.
    With a layer, E* is that of the layer.

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
        The bodies, with E* and hardness [MPa].

    Raises
    ------
    InputError
        If the surrogate cannot predict these bodies. Also if a scene that has to give the layer
        draws it, or another input has a different one or none; or if the scenes that have to give
        the hardness have several over E*, or only some of them have one.
    """
    layered = order.layered
    if layered is None and order.e_star is None:
        layered = law_surfaces.layered_body()
    e_star = order.e_star
    modulus = order.e_star or surrogate.modulus  # E* of the bodies [MPa]
    body: bem.Layered | None = None
    if layered is not None:
        e_star = None  # `Surrogate.bodies` takes it from the layer
        modulus = layered.e_star
        body = under_a_rigid_body(layered)
    hardness = order.hardness
    if hardness is None:
        hardness_ratio = law_surfaces.hardness_ratio()
        if hardness_ratio is not None:
            hardness = hardness_ratio * modulus
    return surrogate.bodies(e_star, hardness, body)


def bodies_of_parameters(surrogate: Surrogate, numbers: Mapping[str, float]) -> Bodies:
    """Return the bodies of a law of new surfaces of a scene.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate of a scene's own features.
    numbers : mapping of str to float
        Parameters of the scene. Those that are features of the surrogate are among them: the
        hardness as "hardness" [MPa] or "hardness_ratio" (over E*), and the thickness [um] and the
        modulus [MPa] of a layer. Without a hardness it is the smallest one of the training, usually
        its only one. Without numbers of a layer the bodies have the layer of the scene.

    Returns
    -------
    Bodies
        The bodies, with E* of the scene or of the layer, and hardness [MPa].
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
    smallest_ratio, _ = limits
    return numbers.get("hardness_ratio", smallest_ratio) * e_star
