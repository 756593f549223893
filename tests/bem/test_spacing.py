"""The distance between nodes, for each boundary of a patch."""

import pytest

from bem.spacing import Boundary, node_spacing


def test_outer_nodes_of_a_free_patch_lie_on_its_border() -> None:
    assert node_spacing(5, 8.0) == 2.0


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_a_patch_without_edges_is_made_of_cells(boundary: Boundary) -> None:
    assert node_spacing(4, 8.0, boundary) == 2.0
    assert node_spacing(1, 8.0, boundary) == 8.0
