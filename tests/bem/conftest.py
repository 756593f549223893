"""Fixtures that run the solver with dense algebra for few nodes in contact, or without it."""

from collections.abc import Iterator

import pytest

from bem import equilibrium
from bem.far_field import flat_punch
from bem.operators import patch as patches

NONE = ((0.0, 1.0),)


def without_dense_algebra(patch: pytest.MonkeyPatch) -> None:
    """Leave every contact set to iterations."""
    patch.setattr(equilibrium, "FEW_NODES", 0)
    patch.setattr(patches, "FEW_FREE", NONE)
    patch.setattr(patches, "FEW_EDGELESS", NONE)


@pytest.fixture
def iterations_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave every contact set to iterations."""
    without_dense_algebra(monkeypatch)


@pytest.fixture(scope="module", params=["few by dense algebra", "iterations alone"])
def both_ways(request: pytest.FixtureRequest) -> Iterator[None]:
    """Run every test of a module with and without dense algebra; for `usefixtures`."""
    flat_punch.cache_clear()  # else it would come from the other way
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "iterations alone":
            without_dense_algebra(patch)
        yield
