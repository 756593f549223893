"""What is said of a version: citation, changelog, installation, compatibility, commit hooks."""

import importlib
import re
import tomllib
from functools import reduce
from pathlib import Path

import pytest

from gen import schema
from gen.runtime import VERSION
from learn.surrogate.file import FORMAT

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DEVELOPERS = {"test", "docs"}
"""Extras for those who change Asperity."""


def text(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def test_the_citation_is_of_this_version():
    yaml = pytest.importorskip("yaml")
    said = yaml.safe_load(text("CITATION.cff"))
    assert said["cff-version"] == "1.2.0"
    assert said["version"] == VERSION
    assert said["license"] == PROJECT["license"]
    assert [each["name"] for each in said["authors"]] == [
        each["name"] for each in PROJECT["authors"]
    ]
    assert said["keywords"] == PROJECT["keywords"]
    _, _, released = versions_of_the_changelog()[0].partition(" ")
    assert released == f"({said['date-released']})"
    (paper,) = said["references"]
    names = [f"{author['given-names'][0]}. {author['family-names']}" for author in paper["authors"]]
    wanted = f"{', '.join(names)}: {paper['title']}".lower()
    assert wanted in " ".join(text("docs/references.md").lower().split())


def versions_of_the_changelog() -> list[str]:
    return re.findall(r"^## (.*)$", text("CHANGELOG.md"), flags=re.MULTILINE)


def test_the_changelog_has_a_section_for_each_version_the_newest_first():
    sections = versions_of_the_changelog()
    assert sections[0].split()[0] == VERSION
    dates = [re.fullmatch(r"\d\S* \((\d{4}-\d\d-\d\d)\)", each) for each in sections]
    days = [date[1] for date in dates if date]
    assert len(days) == len(sections)
    assert days == sorted(days, reverse=True)


def test_wheels_that_documents_name_are_of_this_version():
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    named = [re.findall(r"asperity-(\S+)-py3", page.read_text(encoding="utf-8")) for page in pages]
    assert {version for each in named for version in each} == {VERSION}


def test_the_table_of_extras_is_whole():
    listed = re.findall(r"^\| `(\w+)` \|", text("docs/install.md"), flags=re.MULTILINE)
    assert set(listed) == PROJECT["optional-dependencies"].keys() - DEVELOPERS


def test_the_table_of_formats_is_that_of_the_code():
    table = re.findall(
        r"^\| (\w+)[^|]*\|[^|]*\| (\d+) \| (.*) \|", text("docs/compatibility.md"), re.M
    )
    assert table == [
        ("database", str(schema.SCHEMA), str(schema.SCHEMA)),
        ("part", str(schema.PART), str(schema.PART)),
        ("results", str(schema.PHYSICS), f"any; continued only with {schema.PHYSICS}"),
        ("surrogate", str(FORMAT), str(FORMAT)),
    ]


def named_in_python() -> list[str]:
    section = text("docs/compatibility.md").split("**Python.**")[1].split("\n## ")[0]
    return re.findall(r"`((?:bem|gen|learn|asperity)\.[\w.]+)`", section)


@pytest.mark.parametrize("name", named_in_python())
def test_names_that_stay_are_there(name):
    parts = name.split(".")
    for count in range(len(parts) - 1, 0, -1):
        try:
            module = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        assert reduce(getattr, parts[count:], module) is not None
        return
    pytest.fail(name)
