"""What is published: numbers of bench/results, the page of reports, and the manual's extensions."""

import base64
import importlib
import json
import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from browser import look
from pages import PAGES, TEXT

from bench.page import page_of
from bench.record import Inputs
from bench.report import PARTS
from docs.extensions.tables import TABLES, markdown_of
from learn.models import LIBRARIES

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "bench" / "results"


def test_every_table_stands_on_a_page_and_every_page_shows_tables_that_there_are():
    assert sorted(re.findall(r"```{result} (\w+)", TEXT)) == sorted(
        [*TABLES, "columns", "preparation"]
    )
    reports = re.findall(r"```{report} (\S+)", TEXT)
    assert sorted(reports) == sorted(part.name for part in PARTS)


@pytest.mark.parametrize("name", [*TABLES, "columns", "preparation"])
def test_tables_of_the_pages_are_filled(name):
    """The rows come from `bench/results` when the pages are built: none is typed a second time."""
    header, rule, *rows = markdown_of(name).splitlines()
    assert len(rows) >= 2
    cells = {line.count(" | ") for line in rows}
    assert cells == {header.count(" | ")} == {rule.count("---") - 1}


def test_no_page_repeats_a_table_of_the_results():
    """README.md is not built, so its table stands in it: tests/test_readme.py holds that."""
    built = "\n".join(text for page, text in PAGES.items() if page != "README.md")
    for name in TABLES:
        for line in markdown_of(name).splitlines()[2:]:
            assert line not in built, line


@pytest.fixture(scope="module")
def page() -> str:
    """The page that `python -m bench page bench/results` writes."""
    pytest.importorskip("jinja2")
    return page_of(
        PARTS, Inputs(RESULTS, RESULTS / "none.h5", RESULTS / "comparison", full=True)
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("width", "printed"),
    [(360, False), (1440, False), (680, True)],
    ids=["phone", "desk", "A4"],
)
def test_the_page_fits(page, tmp_path, width, *, printed):
    (tmp_path / "index.html").write_text(page, encoding="utf-8")
    seen = look(tmp_path / "index.html", width, printed=printed)
    assert seen.complaints == []
    assert seen.broken_pictures == 0
    assert seen.content_width <= width


@pytest.mark.parametrize(
    "record", sorted(RESULTS.glob("*/*.part.json")), ids=lambda p: p.name
)
def test_every_part_says_how_it_came(record, page):
    found = json.loads(record.read_text(encoding="utf-8"))
    assert found["command"].startswith("python -m ")
    assert re.fullmatch(r"[0-9a-f]{40}", found["commit"])
    assert found["machine"]["processor"]
    assert found.get("finished", True)
    report = " ".join(found["command"].split()[:4])
    assert re.sub(r"^python -m (?=gen|learn|bench)", "asperity ", report) in page
    assert found["commit"][:7] in page


def test_every_part_is_on_the_page_as_published(page):
    parts = dict(re.findall(r'<h3 id="([\w-]+)"(.*?)(?=<h3|$)', page, flags=re.DOTALL))
    assert parts.keys() == {part.name for part in PARTS}
    assert all("<img " in shown or "<table>" in shown for shown in parts.values())
    assert not re.findall(r"Not here. It is made by: python -m", page), "not run yet"
    assert "cannot be read" not in page


def test_every_picture_is_shown_somewhere(page):
    for picture in RESULTS.rglob("*.png"):
        shown = base64.b64encode(picture.read_bytes()).decode() in page
        assert shown or picture.relative_to(ROOT).as_posix() in TEXT, picture


@pytest.mark.parametrize("name", ["comparison", "comparison-hybrid"])
def test_comparisons_are_of_the_same_data_and_say_their_versions(name):
    record = json.loads((RESULTS / name / "area" / "comparison.json").read_text("utf-8"))
    other = json.loads(
        (RESULTS / "comparison" / "area" / "comparison.json").read_text("utf-8")
    )
    for key in ("database_sha256", "train_rows", "test_rows", "seed", "area_max"):
        assert record["conditions"][key] == other["conditions"][key]
    assert set(record["conditions"]["versions"]) == set(LIBRARIES)


def test_nothing_large_is_published():
    page = RESULTS / "index.html"  # a reader's own, which git leaves out
    files = [path for path in RESULTS.rglob("*") if path.is_file() and path != page]
    sizes = {path: path.stat().st_size for path in files}
    assert not [path for path in sizes if path.suffix == ".h5"]
    assert sum(sizes.values()) < 5e6


def extension(name):
    """An extension as Sphinx imports it, where Sphinx is installed."""
    pytest.importorskip("sphinx")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs" / "extensions"))
        return importlib.import_module(name)


def test_pages_show_all_pictures_that_the_build_draws():
    pictures = extension("pictures")
    shown = re.findall(r"```{picture} (\w+)", TEXT)
    assert sorted(shown) == sorted([*pictures.DRAWINGS, *pictures.GALLERY])


def test_pictures_are_of_what_the_pages_show_to_be_done():
    pictures = extension("pictures")
    for steps in (pictures.README_STEPS, *pictures.DRAWINGS.values()):
        for step in steps:
            assert step.file in " ".join(pictures.command_of(step))
    law = pictures.command_of(*pictures.DRAWINGS["law"])
    assert law[1:5] == ["-m", "gen", "law", "paper"]


def test_a_picture_that_nothing_draws_is_an_error():
    pictures = extension("pictures")
    with pytest.raises(
        LookupError, match=r"README.md shows nothing that writes none.png"
    ):
        pictures.command_of(pictures.Step("README.md", "none.png"))


def test_the_picture_of_the_readme_is_drawn_by_the_code_of_today():
    pictures = extension("pictures")
    drawn_by = pictures.README_DIGEST.read_text(encoding="utf-8").strip()
    assert pictures.readme_digest() == drawn_by, "draw it anew: make figures"


def test_pages_of_classes_list_documented_members_of_the_house_alone():
    members = extension("members").documented_members(ROOT / "docs" / "api")
    contact = members["bem.Contact"]
    assert {"grid_error", "conductance"} <= set(contact["methods"])
    assert {"gap", "stiffness"} <= set(contact["attributes"])
    listed = [
        name for kinds in members.values() for names in kinds.values() for name in names
    ]
    assert not [name for name in listed if name.startswith(("_", "model_"))]


def test_links_that_lead_nowhere_are_found(tmp_path):
    check = extension("link_check")
    (tmp_path / "sub").mkdir()
    (tmp_path / "index.html").write_text(
        '<h1 id="top">A</h1><a href="sub/other.html#place">good</a><a href="#top">good</a>'
        '<a href="sub/other.html#gone">bad</a><a href="none.html">bad</a><img src="none.png">'
        '<a href="https://example.org/a?b#c">elsewhere</a>'
    )
    (tmp_path / "sub" / "other.html").write_text(
        '<p id="place"><a href="../index.html">good</a>'
    )
    pages = check.read_pages(tmp_path)
    broken = [(path.name, link) for path, link in check.broken_links(pages)]
    assert broken == [
        ("index.html", "none.html"),
        ("index.html", "none.png"),
        ("index.html", "sub/other.html#gone"),
    ]
    assert check.external_links(pages) == ["https://example.org/a?b#c"]


@pytest.mark.parametrize(
    ("block", "fault"),
    [
        ("```{report} none\n```", KeyError),
        ("```{result} cost\nbench/results/peers/peers.csv\n```", ValueError),
    ],
)
def test_a_block_that_names_what_is_not_there_stops_the_build(tmp_path, block, fault):
    results = extension("results")
    environment = SimpleNamespace(
        doc2path=lambda _: str(tmp_path / "page.md"),
        note_dependency=lambda *_, **__: None,
    )
    with pytest.raises(fault):
        results.fill(SimpleNamespace(env=environment), "page", [f"{block}\n"])
