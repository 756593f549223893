"""What is installed: every package of ours, and neither tests nor results."""

import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOT_INSTALLED = {"bench/suites"}
"""Folders with Python files that only a clone has."""


def test_a_wheel_has_every_package_and_no_tests():
    setuptools = pytest.importorskip("setuptools")
    said = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    settings = said["tool"]["setuptools"]["packages"]["find"]
    assert not settings.pop("namespaces")
    found = {name.replace(".", "/") for name in setuptools.find_packages(ROOT, **settings)}
    ours = {
        path.parent.relative_to(ROOT).as_posix()
        for package in ("bem", "gen", "learn", "bench")
        for path in (ROOT / package).rglob("*.py")
    }
    assert found == ours - NOT_INSTALLED
    assert ours >= NOT_INSTALLED
    assert not [path for name in found for path in (ROOT / name).glob("test_*.py")]
