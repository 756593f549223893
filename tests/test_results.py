"""What is published: numbers of the README are those of bench/results, which say how they came."""

import base64
import csv
import json
import lzma
import re
from collections.abc import Callable
from pathlib import Path
from zlib import crc32

import pytest

from bench.page.html import page_of
from bench.page.inputs import Inputs
from bench.page.parts import PARTS
from learn.comparison.folder import LIBRARIES
from learn.comparison.tables import hours
from learn.models import MODELS

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = ROOT / "bench" / "results"
FEATURES = "paper", "dimensionless", "hybrid"
Row = dict[str, str]


def table(name: str) -> list[Row]:
    with (RESULTS / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def scores(comparison: str) -> dict[tuple[str, str], Row]:
    found = table(f"{comparison}/area/scores.csv")
    return {(row["model"], row["result"]): row for row in found}


def cells(row: Row, *names: str) -> str:
    return " | ".join(f"{float(row[name]):.2f}" for name in names)


def pair(row: Row, first: str, second: str) -> str:
    return f"{float(row[first]):.2f}, {float(row[second]):.2f}"


def models() -> list[str]:
    names = "nmse", "nmae", "nmaxe", "r2"
    lines = []
    for (model, result), row in scores("comparison").items():
        title = MODELS[model].title + (", tuned" if result == "tuned" else "")
        theirs = cells(row, *(f"paper_{name}" for name in names))
        lines.append(f"| {title} | {cells(row, *names)} | {theirs} |")
    return lines


def hybrid() -> list[str]:
    paper, other = scores("comparison"), scores("comparison-hybrid")
    return [
        f"| {MODELS[model].title} | {pair(paper[model, 'baseline'], 'nmse', 'r2')}"
        f" | {pair(other[model, 'baseline'], 'nmse', 'r2')} |"
        for model in MODELS
    ]


def mirco() -> list[str]:
    """R2 of baselines with the preset's influence coefficients, with MIRCO's, and the paper's."""
    preset, concentrated = scores("comparison"), scores("comparison-concentrated")
    lines = []
    for model in MODELS:
        row, other = preset[model, "baseline"], concentrated[model, "baseline"]
        columns = cells(row, "r2"), cells(other, "r2"), cells(row, "paper_r2")
        lines.append(f"| {MODELS[model].title} | {' | '.join(columns)} |")
    return lines


def surrogates() -> list[str]:
    found: dict[str, list[str]] = {}
    for row in table("generalisation/generalisation.csv"):
        if "same heights" not in row["tested_on"]:
            found.setdefault(row["tested_on"], []).append(pair(row, "r2", "nmae"))
    return [f"| {' | '.join([name, *columns])} |" for name, columns in found.items()]


SOLVERS = {
    "ContactMechanics, dual conjugate gradients, on the free half-space": (
        "ContactMechanics dual",
    ),
    "the same, with a margin that makes its FFT fast": ("ContactMechanics dual, margin",),
    "Tamaas, with such a margin": ("Tamaas, margin",),
    "ASPHER, as it comes (it is given the load)": ("ASPHER",),
    "ASPHER, on nested grids, with a margin, the faster of its two operators": (
        "ASPHER nested, stencil, margin",
        "ASPHER nested, FFT, margin",
    ),
    "the paper's algorithm, up to 1,200 nodes in contact": ("paper's NNLS",),
}


def peers() -> list[str]:
    """Smallest and largest ratio over the displacements, of the faster of several variants."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    for row in table("peers/peers.csv"):
        if row["times_ours"] and row["hurst"] == "0.65":
            ratios = found.setdefault((row["solver"], row["nodes"]), {})
            ratios[row["delta_um"]] = float(row["times_ours"])

    def ends(names: tuple[str, ...], nodes: str) -> str:
        each = [found[name, nodes] for name in names]
        best = [min(ratios[delta] for ratios in each if delta in ratios) for delta in each[0]]
        low, high = (f"{each:.{2 if each < 100 else 3}g}" for each in (min(best), max(best)))
        return low if len(best) == 1 else f"{low} to {high}"

    sizes = sorted({nodes for _, nodes in found}, key=int)
    return [
        f"| {title} | {' | '.join(ends(names, nodes) for nodes in sizes)} |"
        for title, names in SOLVERS.items()
    ]


def cost() -> list[str]:
    rows = [row for row in table("cost/cost.csv") if row["solver"] == "ours"]
    found = {(row["asked"], row["features"]): row for row in rows}

    def line(title: str, asked: str, text: Callable[[Row], str]) -> str:
        columns = [text(found[asked, features]) for features in FEATURES]
        return f"| {title} | {' | '.join(columns)} |"

    def cheaper(row: Row) -> str:
        return f"{float(row['solve']) / float(row['query']):.3g}"

    return [
        line(
            "pays from so many contacts on", "new surfaces", lambda r: f"{int(r['break_even']):,}"
        ),
        line(
            "an answer, with its statistics, is cheaper than a solve, times",
            "new surfaces",
            cheaper,
        ),
        line(
            "a further load on a known surface, than the next of a ladder, times",
            "loads on one surface",
            cheaper,
        ),
    ]


def grids() -> list[str]:
    searched = {row["model"]: row["searched"] for row in table("comparison/area/tuning.csv")}
    lines = []
    for row in table("comparison/area/whole-grids.csv"):
        ours, theirs = hours(float(row["seconds"])), hours(float(row["paper_s"]))
        if row["fits"] != row["of"]:
            error = 100 * float(row["error"]) / float(row["seconds"]) if row["error"] else None
            ours += "" if error is None else f" +- {error:.0f} %"
        how = searched.get(row["model"], "not searched")
        title = MODELS[row["model"]].title
        timed = f"{row['fits']} of {row['of']} | {int(row['rows']):,}"
        lines.append(f"| {title} | {timed} | {ours} | {theirs} | {how} |")
    return lines


def unstated() -> list[str]:
    lines = []
    for row in table("unstated/unstated.csv"):
        ours = f" instead of {row['ours']}" if row["ours"] else ""
        what = f"{row['choice']}: {row['other']}{ours}" if row["other"] else row["choice"]
        times = cells(row, "area_times", "force_times")
        shares = " | ".join(f"{float(row[name]):.0f}" for name in ("done", "table_1"))
        lines.append(f"| {what} | {shares} | {times} | {cells(row, 'r2', 'tree_r2')} |")
    return lines


TABLES = {
    "peers": peers,
    "models": models,
    "hybrid": hybrid,
    "mirco": mirco,
    "surrogates": surrogates,
    "cost": cost,
    "grids": grids,
    "unstated": unstated,
}


@pytest.mark.parametrize(("marker", "expected"), TABLES.items())
def test_tables_of_the_readme_are_those_of_the_results(
    marker: str, expected: Callable[[], list[str]]
) -> None:
    block = README.split(f"<!-- {marker} -->")[1].split(f"<!-- /{marker} -->")[0].strip()
    assert block.splitlines()[2:] == expected()


@pytest.fixture(scope="module")
def page() -> str:
    """The page that `python -m bench page bench/results` writes."""
    pytest.importorskip("jinja2")
    return page_of(PARTS, Inputs(RESULTS, RESULTS / "none.h5", RESULTS / "comparison", full=True))


@pytest.mark.parametrize("record", sorted(RESULTS.glob("*/*.part.json")), ids=lambda p: p.name)
def test_every_part_says_how_it_came(record: Path, page: str) -> None:
    found = json.loads(record.read_text(encoding="utf-8"))
    assert found["command"].startswith("python -m ")
    assert re.fullmatch(r"[0-9a-f]{40}", found["commit"])
    assert found["machine"]["processor"]
    assert found["finished"]
    report = " ".join(found["command"].split()[:4])
    assert report in page
    assert found["commit"][:7] in page


SHOWN = {
    "solver": (1, 0, 0x00000000),
    "peers": (3, 5, 0xE79970DD),
    "growth": (2, 1, 0xC69B18E1),
    "hertz": (1, 0, 0x00000000),
    "theory": (2, 0, 0x00000000),
    "stability": (0, 3, 0xD2BCAC28),
    "scale": (1, 1, 0xCA82B964),
    "comparison": (0, 2, 0x878D84F1),
    "tuning": (0, 1, 0x13436DE1),
    "grids": (0, 1, 0x35772F9C),
    "models": (1, 1, 0xA9BC842C),
    "tolerance": (1, 1, 0xD323C97D),
    "generalisation": (1, 1, 0x7C75B17C),
    "cost": (1, 1, 0xA3F87E7F),
    "throughput": (0, 1, 0x5D0897D2),
    "memory": (0, 1, 0xA59AEEB4),
    "paper": (13, 7, 0x6F585B83),
    "unstated": (1, 3, 0xD9D70DBE),
    "benchmarks": (0, 1, 0x5B5B351C),
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
    assert left_out == [
        "Stiff and extreme cases of the loads",
        "Stiff and extreme cases of the hardness",
        "Stiff and extreme cases of the edgeless",
    ], "not run at full size"
    assert "Not here." not in page
    assert "cannot be read" not in page


def test_every_picture_is_shown_somewhere(page: str) -> None:
    for picture in RESULTS.rglob("*.png"):
        shown = base64.b64encode(picture.read_bytes()).decode() in page
        assert shown or picture.relative_to(ROOT).as_posix() in README, picture


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
    assert sum(seconds) / 3600 == pytest.approx(6.0, abs=0.5)
    said = (RESULTS / "README.md").read_text(encoding="utf-8")
    assert "for how long (six hours of one" in said


def test_nothing_large_is_published() -> None:
    sizes = {path: path.stat().st_size for path in RESULTS.rglob("*") if path.is_file()}
    assert not [path for path in sizes if path.suffix == ".h5"]
    assert sum(sizes.values()) < 6e6
