"""A place for a database."""

import pytest


@pytest.fixture
def path(tmp_path):
    return tmp_path / "some.h5"
