"""What is published: numbers of the pages are those of bench/results, which say how they came."""

import base64
import csv
import json
import lzma
import re
from pathlib import Path
from zlib import crc32

import pytest
from browser import look
from pages import TEXT

from bench.page import page_of
from bench.record import Inputs
from bench.report import PARTS
from docs.extensions.tables import TABLES, markdown_of
from learn.comparison.folder import LIBRARIES
from learn.models import MODELS

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "bench" / "results"


def table(name: str) -> list[dict[str, str]]:
    with (RESULTS / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_every_table_stands_on_a_page_and_every_page_shows_tables_that_there_are() -> None:
    assert sorted(re.findall(r"```{result} (\w+)", TEXT)) == sorted(
        [*TABLES, "columns", "preparation"]
    )
    reports = re.findall(r"```{report} (\S+)", TEXT)
    assert sorted(reports) == sorted(part.name for part in PARTS)


@pytest.mark.parametrize("name", [*TABLES, "columns"])
def test_tables_of_the_pages_are_filled(name: str) -> None:
    """The rows come from `bench/results` when the pages are built: none is typed a second time."""
    header, rule, *rows = markdown_of(name).splitlines()
    assert len(rows) >= 2
    cells = {line.count(" | ") for line in rows}
    assert cells == {header.count(" | ")} == {rule.count("---") - 1}


def test_no_page_repeats_a_table_of_the_results() -> None:
    for name in TABLES:
        for line in markdown_of(name).splitlines()[2:]:
            assert line not in TEXT, line


@pytest.fixture(scope="module")
def page() -> str:
    """The page that `python -m bench page bench/results` writes."""
    pytest.importorskip("jinja2")
    return page_of(PARTS, Inputs(RESULTS, RESULTS / "none.h5", RESULTS / "comparison", full=True))


@pytest.mark.long
@pytest.mark.parametrize(
    ("width", "printed"), [(360, False), (1440, False), (680, True)], ids=["phone", "desk", "A4"]
)
def test_the_page_fits(page: str, tmp_path: Path, width: int, *, printed: bool) -> None:
    (tmp_path / "index.html").write_text(page, encoding="utf-8")
    seen = look(tmp_path / "index.html", width, printed=printed)
    assert seen.complaints == []
    assert seen.broken_pictures == 0
    assert seen.content_width <= width


@pytest.mark.parametrize("record", sorted(RESULTS.glob("*/*.part.json")), ids=lambda p: p.name)
def test_every_part_says_how_it_came(record: Path, page: str) -> None:
    found = json.loads(record.read_text(encoding="utf-8"))
    assert found["command"].startswith("python -m ")
    assert re.fullmatch(r"[0-9a-f]{40}", found["commit"])
    assert found["machine"]["processor"]
    assert found.get("finished", True)
    report = " ".join(found["command"].split()[:4])
    assert report in page
    assert found["commit"][:7] in page


SHOWN = {
    "solver": (1, 0, 0x00000000),
    "peers": (1, 1, 0x367B490E),
    "growth": (1, 1, 0x497D2B74),
    "hertz": (1, 0, 0x00000000),
    "yielding": (1, 1, 0xCB8D3D15),
    "hardness": (1, 2, 0xDA28CBBD),
    "yielding-surrogate": (0, 1, 0x69E98F91),
    "periodic": (1, 2, 0x1B7A3AD8),
    "theory": (2, 0, 0x00000000),
    "stability": (0, 6, 0x0843641A),
    "calculix": (1, 1, 0x782416EC),
    "threads": (1, 2, 0xC49A5BEC),
    "speedup": (0, 1, 0x835C75AD),
    "databases": (0, 1, 0xD5FCBEDD),
    "outputs": (0, 1, 0x73B5BF42),
    "scale": (1, 1, 0x3E514994),
    "writers": (0, 1, 0x5991980C),
    "faults": (0, 1, 0x726B0A22),
    "comparison": (0, 2, 0xF22B1950),
    "tuning": (0, 1, 0xCEF47EB0),
    "grids": (0, 1, 0xC78675C3),
    "comparison-hybrid": (0, 1, 0x1AE00F86),
    "comparison-concentrated": (0, 1, 0xE1F5760D),
    "models": (1, 1, 0x31CA4971),
    "features": (1, 1, 0xE35BF21B),
    "tolerance": (1, 1, 0xD1FF07F8),
    "grow": (2, 1, 0x89A5386B),
    "cost": (1, 1, 0x21FAB547),
    "throughput": (0, 1, 0x5D3588E7),
    "memory": (0, 1, 0xD950CF12),
    "generalisation": (1, 1, 0x0C31F533),
    "coverage": (0, 1, 0x3663DF2D),
    "scans": (1, 1, 0x66204D04),
    "paper": (13, 7, 0xE3006570),
    "unstated": (1, 3, 0xEFA99BA9),
    "nearest": (1, 5, 0xA660F320),
    "benchmarks": (0, 1, 0xAC2078E4),
}
"""Pictures and tables of each part as published, and a checksum of the tables' texts."""


def test_pictures_and_tables_of_the_page_are_those_published(page: str) -> None:
    found = {}
    for part in re.split(r'<h3 id="', page)[1:]:
        tables = re.findall(r"<table>.*?</table>", part, flags=re.DOTALL)
        words = re.sub(r"(<[^>]*>|\s)+", " ", " ".join(tables))
        found[part.partition('"')[0]] = part.count("<img "), len(tables), crc32(words.encode())
    assert found == SHOWN
    left_out = re.findall(r"Left out: ([^.]*)\.", page)
    assert not left_out, "not run at full size"
    missing = re.findall(r"Not here. It is made by: python -m (?:bench |tests\.)(\w+)", page)
    assert not missing, "not run yet"
    assert "cannot be read" not in page


def test_every_picture_is_shown_somewhere(page: str) -> None:
    for picture in RESULTS.rglob("*.png"):
        shown = base64.b64encode(picture.read_bytes()).decode() in page
        assert shown or picture.relative_to(ROOT).as_posix() in TEXT, picture


@pytest.mark.parametrize("name", ["comparison", "comparison-hybrid"])
def test_comparisons_are_of_the_same_data_and_say_their_versions(name: str) -> None:
    record = json.loads((RESULTS / name / "area" / "comparison.json").read_text("utf-8"))
    other = json.loads((RESULTS / "comparison" / "area" / "comparison.json").read_text("utf-8"))
    for key in ("database_sha256", "train_rows", "test_rows", "seed", "area_max"):
        assert record["conditions"][key] == other["conditions"][key]
    assert set(record["conditions"]["versions"]) == set(LIBRARIES)


def test_finished_fits_are_those_of_their_comparison() -> None:
    folder = RESULTS / "comparison" / "area"
    conditions = json.loads((folder / "comparison.json").read_text("utf-8"))["conditions"]
    files = sorted((folder / "trials").glob("*.jsonl.xz"))
    assert {path.name.removesuffix(".jsonl.xz") for path in files} == set(MODELS)
    for path in files:
        lines = lzma.decompress(path.read_bytes()).decode().splitlines()
        assert json.loads(lines[0]) == conditions
        assert all(json.loads(line)["rows"] <= conditions["train_rows"] for line in lines[1:])


def test_searches_took_the_time_that_is_said() -> None:
    seconds = [float(row["fit_seconds"]) for row in table("comparison/area/tuning-times.csv")]
    assert len(seconds) == len(MODELS)
    said = (RESULTS / "README.md").read_text(encoding="utf-8")
    assert f"of which the finished fits have {sum(seconds) / 3600:.1f};" in said


def test_what_the_manual_says_of_unflagged_rows_is_what_was_counted() -> None:
    page = (ROOT / "docs" / "how-to" / "several-databases.md").read_text(encoding="utf-8")
    words = " ".join(page.split())
    found = {(row["trained_on"], row["tested_on"]): row for row in table("coverage/coverage.csv")}

    def of(name: str, *cases: tuple[str, str]) -> list[str]:
        factor, digits = (1, 2) if name == "nmae" else (100, 1)
        return [f"{factor * float(found[case][name]):.{digits}f}" for case in cases]

    first = (
        "{} % on other rows of 257 nodes; the rows of `paper` alone have {} %, all rows flagged,"
        " and the 20 rows alone have {} %"
    )
    for nodes, text in ((257, first), (513, "At 513 nodes they are {}, {} and {} %")):
        fine = f"fine-{nodes}"
        trained = f"preset and 20 rows of {fine}", "preset", f"20 rows of {fine}"
        assert text.format(*of("nmae", *((each, fine) for each in trained))) in words
    share = "covered_unflagged"
    (hurst,) = of(share, ("preset, H to 0.7", "Hurst exponents above"))
    (other,), (error,) = (of(name, ("preset", "midpoint")) for name in (share, "error"))
    assert f"{hurst} % on unseen Hurst exponents, {other} % (standard error {error})" in words
    pairs = [(f"preset and 20 rows of fine-{nodes}", f"fine-{nodes}") for nodes in (257, 513)]
    assert "{} and {} % on finer grids".format(*of(share, *pairs)) in words
    (left_out,) = of(share, ("broad without diamond-square", "diamond-square"))
    assert f"are left out, {left_out} % of the rows without a flag" in words
    scenes = [f"diamond-square: broad-{name}" for name in ("rmd", "yielding")]
    elastic, yielding = of(share, *(("broad without diamond-square", each) for each in scenes))
    assert f"{elastic} % of the elastic ones, but {yielding} % of those of bodies" in words
    (flagged,) = of("flagged", ("broad without spectra", "spectra"))
    assert f"without the spectra flags {flagged} % of the rows of spectra" in words


def test_nothing_large_is_published() -> None:
    page = RESULTS / "index.html"  # a reader's own, which git leaves out
    files = [path for path in RESULTS.rglob("*") if path.is_file() and path != page]
    sizes = {path: path.stat().st_size for path in files}
    assert not [path for path in sizes if path.suffix == ".h5"]
    assert sum(sizes.values()) < 6e6
