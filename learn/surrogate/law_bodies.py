"""The bodies of a law that a surrogate predicts: E*, hardness, and the layer of the training."""

from collections.abc import Mapping

from gen.law import Order
from gen.law.surfaces import LawSurfaces, layered_body_of
from gen.material import Bodies, LayeredBody
from gen.runtime.errors import InputError
from gen.scene import Scene
from learn.surrogate.model import Surrogate


def bodies_of_surfaces(
    surrogate: Surrogate, order: Order, law_surfaces: LawSurfaces
) -> Bodies:
    """Return the bodies of a law of surfaces.

    E* is that of the order, or else of the training. The hardness is that of the order, or else of
    the scenes, or else of the training. A layer is that of the training.

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
        If the surrogate cannot predict these bodies, or a scene has another layer than the
        training.
    """
    layered = _layered_body(surrogate)
    _require_layer_of_training(layered, law_surfaces)
    if layered is not None and order.e_star not in {None, layered.e_star}:
        raise InputError(
            f"E* = {order.e_star:g} MPa: the surrogate holds for its own layer of {layered.text}:"
            " leave out --young, --poisson and --e-star"
        )
    hardness = order.hardness
    if hardness is None:
        ratio = law_surfaces.hardness_ratio()
        if ratio is not None:
            hardness = ratio * (order.e_star or surrogate.modulus)
    bodies = surrogate.bodies(order.e_star, hardness)
    return bodies._replace(layered=layered)


def bodies_of_parameters(surrogate: Surrogate, numbers: Mapping[str, float]) -> Bodies:
    """Return the bodies of a law of new surfaces of a scene.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate of a scene's own features.
    numbers : mapping of str to float
        Parameters of the scene. They have the hardness as "hardness" [MPa] or "hardness_ratio"
        (over E*) if it is a feature. Otherwise it is the smallest hardness of the training,
        usually its only one.

    Returns
    -------
    Bodies
        The bodies [MPa], whose E* is that of the scene.

    Raises
    ------
    InputError
        If layers were drawn for the training.
    """
    return Bodies(
        e_star=surrogate.modulus,
        hardness=_hardness(surrogate, numbers),
        has_modulus=True,  # The scene fixes E*.
        layered=_layered_body(surrogate),
    )


def _hardness(surrogate: Surrogate, numbers: Mapping[str, float]) -> float | None:
    """Return the hardness of a scene's contacts [MPa]; None for elastic bodies.

    `numbers` are those of `bodies_of_parameters`.
    """
    if "hardness" in numbers:
        return numbers["hardness"]
    limits = surrogate.hardness_limits  # over E*
    if limits is None:
        return None
    ratio = numbers.get("hardness_ratio", limits[0])
    return ratio * surrogate.modulus


def _layered_body(surrogate: Surrogate) -> LayeredBody | None:
    """Return the layered body of the training; None for half-spaces.

    Raises InputError if layers were drawn for the training.
    """
    if "layer" not in surrogate.card:
        return None
    scene = Scene.from_text(str(surrogate.card["scene"]))
    return layered_body_of(scene, str(surrogate.card["title"]))


def _require_layer_of_training(
    trained: LayeredBody | None, law_surfaces: LawSurfaces
) -> None:
    """Refuse scenes with another layer than that of the training, which is None for half-spaces."""
    for about in law_surfaces.inputs:
        if about.scene is None:
            continue
        layered = layered_body_of(about.scene, about.description)
        if layered is None or layered == trained:
            continue
        bodies_of_training = "half-spaces"
        if trained is not None:
            bodies_of_training = f"a layer of {trained.text}"
        raise InputError(
            f"{about.description}: has a layer of {layered.text}, and the surrogate holds for"
            f" {bodies_of_training}"
        )
