"""Figures in the text of README.md and docs/ are those of `bench/results`.

Tables come from there when the manual is built (`tests/test_results.py`). `figures.toml` says for
each figure of a sentence which cell of a table it is, which test below or elsewhere computes it, or
why it needs none: so no number of a page changes alone, and no new one comes without a source.
"""

import re
import tomllib
from fnmatch import fnmatch
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np
import pytest
from pages import PAGES, ROOT

import gen.cli
from bench.files import named, read_table
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import Scene
from gen.surface import generate

RESULTS = ROOT / "bench" / "results"


def rows(name: str) -> list[dict[str, str]]:
    """Read a table of the results, compressed or not."""
    return read_table(RESULTS / name)[1]


NUMBER = r"(-?[\d,]*\d(?:\.\d+)?)"
UNITS = (
    r"%|times\b|-fold|s\b|ms\b|milliseconds|seconds|minutes|min\b|h\b|hours|[GMk]i?B\b"
)
FIGURE = re.compile(rf"\d[\d.,]*\s?(?:{UNITS})")
"""What counts as a figure of a page: a number with one of these units."""

FIGURES: dict[str, list[dict[str, Any]]] = tomllib.loads(
    (ROOT / "tests" / "figures.toml").read_text(encoding="utf-8")
)
ENTRIES = [entry for entries in FIGURES.values() for entry in entries]


def pattern(sentence: str) -> re.Pattern[str]:
    """Return what finds a sentence, in which `#` stands for each number; blanks are the same."""
    words = r"\s+".join(re.escape(word) for word in sentence.split())
    return re.compile(words.replace(r"\#", NUMBER))


def stated(page: str, sentence: str) -> list[float]:
    """Return the numbers of a sentence."""
    (found,) = pattern(sentence).finditer(PAGES[page])
    return [float(text.replace(",", "")) for text in found.groups()]


def prose(text: str) -> str:
    """Return a page with blanks in the place of code, so that all else stays where it is."""
    code = r"^```.*?^```$|`[^`]*`|^ {4}[^\n]*"
    return re.sub(
        code, lambda m: re.sub(r"\S", " ", m[0]), text, flags=re.DOTALL | re.MULTILINE
    )


def figures_without_a_source(page: str, text: str) -> list[str]:
    """Return the figures of a page that stand in none of the sentences of `figures.toml`."""
    sentences = [pattern(entry["says"]) for entry in ENTRIES if entry["page"] == page]
    told = [found.span() for each in sentences for found in each.finditer(text)]
    return [
        found[0]
        for found in FIGURE.finditer(prose(text))
        if not any(start <= found.start() and found.end() <= stop for start, stop in told)
    ]


@pytest.mark.parametrize("page", PAGES)
def test_every_figure_of_a_page_has_a_source(page):
    missing = figures_without_a_source(page, PAGES[page])
    assert not missing, (
        f"{page}: tell in tests/figures.toml where these come from: {missing}"
    )


def test_a_figure_without_a_source_is_found():
    text = (
        PAGES["README.md"]
        + "\nIt is 17 times faster, in `3 s`, by 4 %.\n\n    took 5 s\n"
    )
    assert figures_without_a_source("README.md", text) == ["17 times", "4 %"]
    sphere = "The force on a sphere is within"
    changed = PAGES["README.md"].replace(sphere, f"{sphere} less than")
    assert len(figures_without_a_source("README.md", changed)) == 1


@pytest.mark.parametrize(
    "entry", ENTRIES, ids=lambda e: f"{e['page']}: {e['says'].strip()[:40]}"
)
def test_every_sentence_is_on_its_page_and_its_source_is_there(entry):
    assert len(pattern(entry["says"]).findall(PAGES[entry["page"]])) == 1
    kinds = entry.keys() & {"cells", "test", "because"}
    assert len(kinds) == 1
    if "test" in entry:
        path, _, name = entry["test"].partition("::")
        assert f"\ndef {name}(" in (ROOT / path).read_text(encoding="utf-8")


def value(cell: dict[str, Any]) -> float:
    """Return the value of a cell as `figures.toml` describes it."""

    def of(where: dict[str, str]) -> float:
        found = [
            row[cell["column"]]
            for path in named(
                RESULTS / Path(cell["file"]).parent, Path(cell["file"]).name
            )
            for row in read_table(path)[1]
            if all(
                fnmatch(row[name], want.lstrip("!")) != want.startswith("!")
                for name, want in where.items()
            )
        ]
        assert found, f"no row of {cell}"
        assert "of" in cell or len(found) == 1, f"{len(found)} rows of {cell}"
        if cell.get("of") == "count":
            return len(found)
        chosen = {
            "mean": mean,
            "min": min,
            "max": max,
            "sum": sum,
            "last": lambda all_: all_[-1],
        }
        return float(chosen[cell.get("of", "min")]([float(text) for text in found]))

    return (
        cell.get("times", 1)
        * of(cell["where"])
        / (of(cell["over"]) if "over" in cell else 1)
    )


@pytest.mark.parametrize(
    "entry", FIGURES["measured"], ids=lambda e: e["says"].strip()[:40]
)
def test_figures_are_those_of_their_cells(entry):
    (found,) = pattern(entry["says"]).finditer(PAGES[entry["page"]])
    for text, cell in zip(found.groups(), entry["cells"], strict=True):
        digits = len(text.partition(".")[2])
        said = float(text.replace(",", ""))
        near = pytest.approx(
            value(cell), rel=cell.get("within", 0), abs=0.500001 * 10.0**-digits
        )
        assert said == near, cell


def test_exponents_are_as_much_smaller_as_is_said():
    """On the page, in what `gen describe` prints, and in the paper's scene."""
    lacking = {
        (row["generator"], row["nodes"], row["asked_for"]): float(row["asked_for"])
        - float(row["hurst"])
        for row in rows("hurst/hurst.csv")
    }
    displaced = [
        each for (generator, *_), each in lacking.items() if generator != "spectral"
    ]
    sentence = "ask for more than the estimate: # to # more on these grids"
    least, most = stated("docs/how-to/scenes.md", sentence)
    assert [least, most] == [round(min(displaced) + 1e-9, 2), round(max(displaced), 2)]
    printer = (ROOT / "gen" / "commands" / "printer.py").read_text(encoding="utf-8")
    assert f"a hurst that is {least} to {most} larger" in printer
    scene = (ROOT / "gen" / "scenes" / "paper.toml").read_text(encoding="utf-8")
    (paper,) = re.findall(r"at 129 nodes a side ([.\d]+) less", scene)
    for hurst in ("0.5", "0.7"):
        assert lacking["diamond-square", "129", hurst] == pytest.approx(
            float(paper), abs=0.005
        )
    spectral = [
        each for (generator, *_), each in lacking.items() if generator == "spectral"
    ]
    assert max(map(abs, spectral)) < 0.02


def test_hertz_is_met_as_closely_as_is_said():
    area = {
        (row["solution"], row["nodes"]): float(row["area_percent"])
        for row in rows("hertz/hertz.csv")
        if float(row["delta_um"]) == 1.0
    }
    nodes, said = stated(
        "docs/results/reports.md",
        "paraboloid at # nodes a side, concentrated forces"
        " (MIRCO's `PressureGreenFunFlag` false) lack # % of the area",
    )
    assert said == round(
        100 * (1 - area["concentrated-force", f"{nodes:.0f}"] / area["hertz", ""])
    )


def least(found: list[dict[str, str]], *case: str) -> list[float]:
    """Return the ratio of the fastest solver of each case to ours."""
    ratios: dict[tuple[str, ...], float] = {}
    for row in found:
        key = tuple(row[name] for name in case)
        ratios[key] = min(ratios.get(key, 1e9), float(row["times_ours"]))
    return list(ratios.values())


def ends(numbers: list[float]) -> list[float]:
    return [min(numbers), max(numbers)]


def test_other_solvers_take_as_long_as_is_said():
    periodic = [
        row
        for row in rows("peers/periodic.csv")
        if row["times_ours"] and row["solver"] != "bem"
    ]
    aspher = [row for row in periodic if row["solver"].startswith("ASPHER")]
    rest = [float(row["times_ours"]) for row in periodic if row not in aspher]
    said = stated(
        "docs/results/reports.md",
        "ASPHER's faster variant takes # to # times the CPU time of ours (least near full contact),"
        " the others # to # times",
    )
    fastest = least(aspher, "nodes", "mean_pressure")
    assert said == pytest.approx([*ends(fastest), *ends(rest)], rel=0.03)


def test_bodies_that_yield_are_compared_as_is_said():
    said = stated(
        "docs/results/reports.md",
        "it takes # to # times the CPU time of ours and # to # times the convolutions;",
    )
    found = [row for row in rows("peers/hardness.csv") if row["hardness"]]
    work = {
        (row["delta_um"], row["hardness"]): float(row["convolutions"])
        for row in found
        if row["solver"] == "bem"
    }
    theirs = [row for row in found if row["solver"] != "bem" and row["times_ours"]]
    times = [float(row["times_ours"]) for row in theirs]
    more = [
        float(row["convolutions"]) / work[row["delta_um"], row["hardness"]]
        for row in theirs
    ]
    assert said == pytest.approx([*ends(times), *ends(more)], rel=0.03)
    elastic = [row for row in rows("peers/hardness.csv") if not row["hardness"]]
    ours = {row["delta_um"]: row for row in elastic if row["solver"] == "bem"}
    pairs = [(row, ours[row["delta_um"]]) for row in elastic if row["solver"] != "bem"]
    said = stated(
        "docs/results/reports.md",
        "elastic solver of ContactMechanics takes # to # times the CPU time and # to # times",
    )
    over = [
        [float(theirs[name]) / float(mine[name]) for theirs, mine in pairs]
        for name in ("seconds", "convolutions")
    ]
    assert said == pytest.approx([*ends(over[0]), *ends(over[1])], rel=0.03)


def test_as_many_rows_lie_beyond_full_contact_as_is_said():
    """Of 600 rows, so to within three standard errors."""
    (percent,) = stated(
        "docs/how-to/boundaries.md", "of the paper these are # % of the rows"
    )
    scene = Scene.parse(
        'samples = 600\n[contact]\nboundary = "periodic"\n[surface]\nnodes = 129\n',
        "the page",
    )
    plan = parameters(scene, 0, 600)
    full = [(h := surface_of(scene, plan, row)).max() - h.mean() for row in range(600)]
    found = 100 * float(np.mean(plan.load > np.array(full)))
    assert percent == pytest.approx(found, abs=6)


def test_an_island_bears_on_its_borders_as_is_said(tmp_path, capsys):
    """What the command says of the surface of the first example."""
    said = stated(
        "docs/how-to/boundaries.md", "at 50 MPa this is # %, on # % of the nodes"
    )
    surface = tmp_path / "surface.npy"
    np.save(surface, generate("diamond-square", 129, 0.7, 12.0, np.random.default_rng(0)))
    material = ["--young", "210e3", "--poisson", "0.3"]
    assert (
        gen.cli.main(["contact", str(surface), "--side=1000", "--pressure=50", *material])
        == 0
    )
    told = " ".join("".join(capsys.readouterr()).split())
    (nodes,) = re.findall(r"the outer 5 % on each side \((\d+) % of the nodes\)", told)
    (force,) = re.findall(r"carry ([0-9.]+) % of the force", told)
    assert said == [round(float(force)), float(nodes)]


def test_files_that_the_text_names_are_there():
    for page, text in PAGES.items():
        for name in re.findall(
            r"`((?:bench/results|tests|examples|figures|gen|learn|bem)/[\w./-]+)`", text
        ):
            assert (ROOT / Path(name)).exists(), f"{page}: {name}"
