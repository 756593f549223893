"""The commit of the checkout, versions, and the command that adds an extra."""

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from gen.runtime import command_line, installation

ROOT = Path(__file__).resolve().parents[3]


def test_a_clone_is_named_by_its_path():
    assert f"pip install -e '{ROOT}[plot]'" in installation.command_for("plot").replace(
        f"{sys.executable} -m ", ""
    )


def test_beside_a_clone_no_index_is_asked(monkeypatch, tmp_path):
    """Whoever asks an index for `asperity` may get somebody else's."""
    monkeypatch.setattr(installation, "REPOSITORY", tmp_path)
    assert installation.command_for("learn") == "install Asperity again, with its extra 'learn'"


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
PACKAGES = ("asperity", "bem", "gen", "learn", "bench")


def test_messages_name_extras_that_there_are():
    sources = [path for name in ("gen", "learn", "bench") for path in (ROOT / name).rglob("*.py")]
    texts = "".join(path.read_text(encoding="utf-8") for path in sources)
    named = set(re.findall(r"""command_for\(['"](\w+)""", texts)) | {*command_line.EXTRAS.values()}
    assert {"mpi", "mpich", "plot", "learn", "instruments", "bench"} <= named <= EXTRAS.keys()


@pytest.mark.parametrize("module", command_line.EXTRAS)
def test_the_extra_of_a_module_brings_it(module):
    names = {"sklearn": "scikit-learn", "tomli_w": "tomli-w", "xgboost": "xgboost-cpu"}
    wanted = names.get(module, module).lower()
    libraries = EXTRAS[command_line.EXTRAS[module]]
    assert wanted in {re.split(r"[<>=;\s]", each)[0].lower() for each in libraries}


def test_every_library_is_always_there_or_of_an_extra():
    """Without it a command says what to install; mpi4py has words of its own."""
    needed = [re.split(r"[<>=]", each)[0] for each in PROJECT["dependencies"]]
    beside = {"PIL", "cycler", "pydantic_core", "markupsafe"}  # come with those that need them
    known = {*needed, *command_line.EXTRAS, *beside, "mpi4py", *PACKAGES}
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            if path.parent.name == "suites":  # run by pytest, with the extra that brings it
                continue
            strangers = set(imports(path)) - known - set(sys.stdlib_module_names)
            assert not strangers, f"{path}: {strangers}"


def imports(path: Path) -> Iterator[str]:
    """Packages that a file imports, also inside its functions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
        yield from (name.partition(".")[0] for name in names)


def test_no_message_names_a_distribution_that_no_index_has():
    """`pip install` is followed by a path, by an expression, or by a name that is listed here."""
    known = {"tamaas", "ContactMechanics", "aspher,", "them"}
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            named = set(re.findall(r"pip install[\"' ]+([^\s\"']+)", text))
            assert named <= known, f"{path}: {named - known}"


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no checkout of git")
def test_the_commit_is_that_of_the_checkout():
    asked = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert installation.git_commit() == asked.stdout.strip()
