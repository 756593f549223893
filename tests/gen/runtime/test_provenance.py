"""Where results come from: the commit of the checkout, and versions of packages."""

import subprocess
from pathlib import Path

import pytest

from gen.runtime.provenance import git_commit, versions

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no checkout of git")
def test_the_commit_is_that_of_the_checkout() -> None:
    asked = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert git_commit() == asked.stdout.strip()


def test_missing_packages_are_left_out() -> None:
    found = versions(("numpy", "a-package-that-nobody-has"))
    assert found.keys() == {"python", "numpy"}
