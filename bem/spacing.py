"""The boundary of a patch, and the distance between its nodes, which follows from it."""

from typing import Literal, get_args

Boundary = Literal["free", "periodic", "mirror"]
BOUNDARIES: tuple[Boundary, ...] = get_args(Boundary)


def node_spacing(nodes: int, side: float, boundary: Boundary = "free") -> float:
    """Return the distance between neighbouring nodes along one axis of a patch [um].

    The outer nodes of a free patch lie on its border. A patch without edges is made of cells, whose
    centres are the nodes: the last cell is followed by the first one, or by its own mirror image.

    Parameters
    ----------
    nodes : int
        Nodes along the axis, at least two for a free patch.
    side : float
        Length of the patch along the axis [um].
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.
    """
    return side / (nodes - 1) if boundary == "free" else side / nodes
