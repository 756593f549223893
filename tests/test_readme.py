"""What the README says is what the code does: its tables, links, scene and commands."""

import importlib
import re
from pathlib import Path

import pytest

from gen.scene import Scene
from gen.schema import markdown_table

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def between(marker: str) -> str:
    return README.split(f"<!-- {marker} -->")[1].split(f"<!-- /{marker} -->")[0].strip()


def test_the_table_of_columns_is_made_from_the_schema():
    assert between("columns") == markdown_table()


@pytest.mark.parametrize("marker", re.findall(r"<!-- (\w+) -->", README))
def test_no_table_was_left_empty(marker):
    assert between(marker).count("|") > 10


@pytest.mark.parametrize("target", re.findall(r"\]\(([^)#]+)\)", README))
def test_links_lead_somewhere(target):
    assert (ROOT / target).exists()


def test_the_scene_shown_is_a_scene():
    (text,) = re.findall(r"```toml\n(.*?)```", README, flags=re.DOTALL)
    assert Scene.parse(text, "README").samples == 2000


@pytest.mark.parametrize("package", ["gen.cli", "learn.cli", "bench.__main__"])
def test_every_command_shown_exists(package):
    app = importlib.import_module(package).app
    known = {command.callback.__name__ for command in app.registered_commands}
    shown = set(re.findall(rf"-m {package.partition('.')[0]} (\w+)", README))
    assert shown <= known
    assert known <= shown, "the README leaves a command out"


def test_python_shown_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    surface, contact, scan = re.findall(r"```python\n(import numpy.*?)```", README, flags=re.DOTALL)
    exec(surface, {})
    names: dict[str, object] = {}
    exec(contact, names)
    assert names["contact"].area_percent > 0
    pytest.importorskip("SurfaceTopography")
    exec(scan, {})
    assert (tmp_path / "scan.x3p").exists()


def test_reading_with_xarray_as_shown(tmp_path, monkeypatch):
    pytest.importorskip("h5netcdf")
    from gen import cli

    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text("samples = 5\n[surface]\nnodes = 9\n")
    assert cli.main(["run", "scene.toml", "-o", "paper.h5", "--rows", "0:4"]) == 0
    (code,) = re.findall(r"```python\n(import xarray.*?)```", README, flags=re.DOTALL)
    names: dict[str, object] = {}
    exec(code, names)
    assert len(names["done"]) == 4
    assert names["rows"]["area_percent"].notna().sum() == 4
