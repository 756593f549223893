"""Fixtures that run the solver with dense algebra for few nodes in contact, or without it."""

from collections.abc import Iterator

import pytest

from bem import half_space
from bem.far_field import flat_punch


@pytest.fixture
def iterations_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave every contact set to iterations."""
    monkeypatch.setattr(half_space, "FEW_PER_ROOT", 0.0)


@pytest.fixture(scope="module", params=["few by dense algebra", "iterations alone"])
def both_ways(request: pytest.FixtureRequest) -> Iterator[None]:
    """Run every test of a module with and without dense algebra; for `usefixtures`."""
    flat_punch.cache_clear()  # else it would come from the other way
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "iterations alone":
            patch.setattr(half_space, "FEW_PER_ROOT", 0.0)
        yield
