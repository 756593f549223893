"""A folder with a database, for the tests of the comparison."""

import pytest


@pytest.fixture
def work(database, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path
