"""A few rows of the paper preset, shared by the tests of the report."""

import pytest

from bench import databases


@pytest.fixture(scope="session")
def preset(tmp_path_factory):
    """120 rows of the paper preset."""
    return databases.of_the_paper(None, tmp_path_factory.mktemp("paper"), 120)
