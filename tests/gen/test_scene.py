"""Scenes: what is read, what is refused and how, and what makes two scenes the same."""

import inspect
import json
import math
import re
import subprocess
import sys
import time
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bem.problem import BOUNDARIES, MAX_ITERATIONS, RTOL, Boundary, node_spacing
from gen import cli
from gen.generation.forecast import planned_loads
from gen.generation.functions import completed
from gen.generators import TAGS
from gen.runtime.errors import InputError
from gen.scene import Piece, Scene, Store, differences, flags, load, preset_names
from gen.scene.columns import columns_for
from gen.scene.tables import UNITS, Contact, Delta, Load

FULL = load("paper").model_dump(mode="json", exclude_none=True)


def test_the_solvers_defaults_are_said_alike_everywhere() -> None:
    """Scenes and commands are read without the solver, whose import takes most of their time."""
    command = inspect.signature(cli.contact).parameters
    for name, default in (("rtol", RTOL), ("max_iterations", MAX_ITERATIONS)):
        assert getattr(load("paper").contact, name) == default
        assert Scene.parse("samples = 1", "a").contact.model_dump()[name] == default
        assert command[name].default == default


def refusal(text: str) -> str:
    """The one line with which a scene's TOML is refused."""
    with pytest.raises(InputError) as refused:
        Scene.parse(text, "some.toml")
    message = str(refused.value)
    assert len(message.splitlines()) == 1
    assert message.isprintable()
    assert message.startswith("some.toml: ")
    return message


def changed(key: str, value: object) -> dict[str, Any]:
    """The paper's scene with another value for one dotted key."""
    content: dict[str, Any] = json.loads(json.dumps(FULL))
    *tables, name = key.split(".")
    table = content
    for part in tables:
        table = table[part]
    table[name] = value
    return content


PIECES = "one or more { share = ..., range = [low, high] }, their shares sum to 1"
BAD_SCENES = [
    # text, and what the message must name: the key, the value, what is allowed
    ("samples = 0", ["samples = 0;", "from 1 to 1000000000"]),
    ("samples = 10.0", ["samples = 10.0;", "a whole number"]),
    ("samples = true", ["samples = true;", "a whole number"]),
    ('samples = "10"', ["samples = '10';", "a whole number"]),
    ("samples = 2025-01-01", ["samples = datetime.date(2025, 1, 1);", "a whole number"]),
    ("samples = 0x" + "f" * 6000, ["samples = a number of thousands of digits;"]),
    ("seed = 1", ["samples is missing", "the number of rows"]),
    ("sample = 10", ["unknown key sample = 10;", "closest known key is samples", "(and 1 more)"]),
    ("samples = 1\nnodes = 65", ["unknown key nodes = 65;", "is surface.nodes"]),
    ("samples = 1\ntitle = 5", ["title = 5;", "text in quotes"]),
    ("samples = 1\nseed = -1", ["seed = -1;", "from 0 to 2^63 - 1"]),
    ("samples = 1\nsamples_per_surface = 0", ["samples_per_surface = 0;", "from 1 to 10000"]),
    ("samples = 1\nsurface = 3", ["surface = 3;", "a table [surface]"]),
    ("samples = 1\n[[contact]]", ["contact = [{}];", "a table [contact]"]),
    ("samples = 1\n[surfaces]\nnodes = 65", ["unknown key surfaces =", "key is surface"]),
    ("samples = 1\n[surface]\nhurts = [0, 1]", ["unknown key surface.hurts = [0, 1];", "e.hurst"]),
    ("samples = 1\n[surface]\nrtol = 1e-3", ["unknown key surface.rtol = 0.001;", "contact.rtol"]),
    ("samples = 1\n[surface]\nnodes = 128", ["surface.nodes = 128;", "2^k + 1", "3 to 4097"]),
    ("samples = 1\n[surface]\nnodes = 8193", ["surface.nodes = 8193;", "3 to 4097"]),
    ("samples = 1\n[surface]\nside = 0", ["surface.side = 0;", "above 0 [um]"]),
    ("samples = 1\n[surface]\nside = nan", ["surface.side = nan;", "finite"]),
    ("samples = 1\n[surface]\nside = 1" + "0" * 400, ["surface.side = 100000", " ...;", "finite"]),
    ("samples = 1\n[surface]\nhurst = [0.5, 1.5]", ["surface.hurst = [0.5, 1.5];", "high <= 1"]),
    ("samples = 1\n[surface]\nhurst = [0.5]", ["surface.hurst = [0.5];", "two numbers"]),
    ("samples = 1\n[surface]\nhurst = ['a', 1]", ["surface.hurst = ['a', 1];", "two numbers"]),
    ("samples = 1\n[surface]\nsigma0 = [-1, 5]", ["surface.sigma0 = [-1, 5];", "0 <= low"]),
    ("samples = 1\n[surface]\ngenerator = 'fractal'", ["'fractal'", "'diamond-square', 'midp"]),
    ("samples = 1\ndelta = [5, 45]", ["delta = [5, 45];", "a table [delta]"]),
    ("samples = 1\ndelta.range = [5, 45]", ["unknown key delta.range =", "delta.pieces.range"]),
    ("samples = 1\ndelta.pieces = []", ["delta.pieces = [];", PIECES, "(the shares sum to 0)"]),
    ("samples = 1\ndelta.pieces = [7]", ["delta.pieces[0] = 7;", PIECES]),
    (
        "samples = 1\ndelta.pieces = [{share=0.5, range=[1, 2]}, {share=0.4, range=[1, 2]}]",
        ["delta.pieces = [{", PIECES, "(the shares sum to 0.9)"],
    ),
    (
        "samples = 1\ndelta.pieces = [{share = 1.0, range = [5, 1]}]",
        ["delta.pieces[0].range = [5, 1];", "low <= high", "(5.0 is above 1.0)"],
    ),
    (
        "samples = 1\ndelta.pieces = [{share = 0, range = [1, 2]}, {share = 1, range = [1, 2]}]",
        ["delta.pieces[0].share = 0;", "above 0"],
    ),
    ("samples = 1\ndelta.pieces = [{share = 1}]", ["delta.pieces[0].range is missing", "[low"]),
    (
        "samples = 1\ndelta.pieces = [{share = 1, range = [-1, 2]}]",
        ["delta.pieces[0].range = [-1, 2];", "0 <= low"],
    ),
    ("samples = 1\n[contact]\nkernel = 'love'", ["contact.kernel = 'love';", "'uniform-pressure'"]),
    ("samples = 1\n[contact]\nfar_field = 1", ["contact.far_field = 1;", "'rigid' or 'compliant'"]),
    (
        "samples = 1\n[contact]\nspacing = 7.8",
        ["contact.spacing = 7.8;", "'side/(n-1)' or 'side/n"],
    ),
    ("samples = 1\n[contact]\nmodulus = 0.0", ["contact.modulus = 0.0;", "above 0 [MPa]"]),
    ("samples = 1\n[contact]\npoisson = 0.51", ["contact.poisson = 0.51;", "at most 0.5"]),
    ("samples = 1\n[contact]\nrtol = 1", ["contact.rtol = 1;", "between 1e-14 and 1"]),
    ("samples = 1\n[contact]\nmax_iterations = 0", ["contact.max_iterations = 0;", "from 1 to"]),
    ("samples = 1\n[contact]\nhardness = 0", ["contact.hardness = 0;", "above 0, or [low, high]"]),
    ("samples = 1\n[contact]\nhardness = inf", ["contact.hardness = inf;", "finite", "[MPa]"]),
    ("samples = 1\n[contact]\nhardness = '2 GPa'", ["contact.hardness = '2 GPa';", "number"]),
    (
        "samples = 1\n[contact]\nhardness_ratio = [0.1, 0.003]",
        ["contact.hardness_ratio = [0.1, 0.003];", "low <= high [E*]", "(0.1 is above 0.003)"],
    ),
    (
        "samples = 1\n[contact]\nhardness_ratio = [0, 0.1]",
        ["contact.hardness_ratio = [0, 0.1];", "0 < low"],
    ),
    (
        "samples = 1\n[contact]\nhardness = 2000\nhardness_ratio = 0.01",
        ["contact: hardness [MPa] and hardness_ratio [E*] are both given: give one"],
    ),
    (
        "samples = 1\n[contact]\nhardness = 2000\nfar_field = 'compliant'",
        ["contact: a hardness needs far_field = 'rigid', not 'compliant'"],
    ),
    (
        "samples = 1\n[contact]\nmodulus = 1e300\nhardness_ratio = 1e9",
        ["contact: the hardness is beyond what numbers hold"],
    ),
    ("samples = 1\n[contact]\nboundary = 'open'", ["contact.boundary = 'open';", "'mirror'"]),
    (
        "samples = 1\n[contact]\nboundary = 'mirror'\nspacing = 'side/(n-1)'",
        ["contact: boundary = 'mirror' needs spacing = 'side/n', not 'side/(n-1)'"],
    ),
    (
        "samples = 1\n[contact]\nboundary = 'periodic'\nfar_field = 'compliant'",
        ["contact: boundary = 'periodic' needs far_field = 'rigid', not 'compliant'"],
    ),
    (
        "samples = 1\n[contact]\nboundary = 'mirror'\nkernel = 'concentrated-force'",
        ["contact: boundary = 'mirror' needs kernel = 'uniform-pressure', not 'concentrated-"],
    ),
    ("samples = 1\n[store]\npressure = 1", ["store.pressure = 1;", "true or false"]),
    ("samples = 1\n[store]\ngap = true", ["unknown key store.gap = true;", "store.mean_gap"]),
    (
        "samples = 0\nseed = -1\n[contact]\nrtol = 2",
        ["samples = 0;", "from 1", "(and 2 more)"],
    ),
    ('samples = 1\n"a\\nb\u2028" = "c\\u001b[31m"', [r"unknown key a\nb\u2028 = ", "closest"]),
    ("", ["is empty", "samples"]),
    ("samples = 1\nseed 5", ["not TOML", "line 2"]),
    ("samples = 1\nsamples = 2", ["not TOML", "Cannot overwrite"]),
    ("samples = 9" + "9" * 5000, ["not TOML", "digits"]),
    (
        "samples = 1\n[delta]\n[load]\nquantity = 'force'\nrange = 5",
        ["[delta] and [load]", "give one of them"],
    ),
    (
        "samples = 1\n[load]\nquantity = 'force'\nrange = 5\n[contact]\nfar_field = 'compliant'",
        ["'force' needs contact.far_field = 'rigid'"],
    ),
    ("samples = " + "[" * 100_000, ["not TOML"]),
]


@pytest.mark.parametrize(
    ("text", "parts"),
    BAD_SCENES,
    ids=[text[:50].encode("unicode_escape").decode() for text, _ in BAD_SCENES],
)
def test_refusal_names_key_value_and_what_is_allowed(text: str, parts: list[str]) -> None:
    message = refusal(text)
    for part in parts:
        assert part in message


def test_whole_numbers_are_numbers() -> None:
    scene = Scene.parse("samples = 1\n[surface]\nside = 500\nhurst = [0, 1]", "some.toml")
    assert scene.surface.side == 500.0
    assert scene.surface.hurst == (0.0, 1.0)


def test_short_scene_has_the_papers_values() -> None:
    assert Scene.parse('samples = 15878\ntitle = "The paper\'s database"', "") == load("paper")


BROAD = ("fine", "midpoint", "rmd", "spectral", "spectral-yielding", "yielding")


def test_broad_scenes_share_no_surface_and_can_be_learnt_together() -> None:
    scenes = [load(f"broad-{name}") for name in BROAD]
    assert len({scene.seed for scene in scenes}) == len(scenes)
    for scene in scenes:
        assert scene.contact.boundary == "free"
        assert scene.sides == (1000.0, 1000.0)
        assert scene.quantity == "delta/height_rms"


@pytest.mark.parametrize("name", preset_names())
def test_presets_load(name: str) -> None:
    scene = load(name)
    assert scene.title
    assert Scene.from_text(scene.text()) == scene


def test_presets_say_what_the_design_says() -> None:
    assert preset_names() == (
        *(f"broad-{name}" for name in BROAD),
        *("extreme", "fine", "paper", "paper-mirco", "paper-nearest", "paper-yielding", "quick"),
    )
    quick, paper, fine = load("quick"), load("paper"), load("fine")
    assert [scene.samples for scene in (quick, paper, fine)] == [256, 15_878, 800]
    assert [scene.shape[0] for scene in (quick, paper, fine)] == [129, 129, 257]
    assert quick.fingerprint() == paper.fingerprint()
    assert differences(paper, fine) == ["surface.nodes: 129 in the file, 257 asked for"]
    assert [line.partition(":")[0] for line in differences(paper, load("paper-mirco"))] == [
        "contact.kernel",
        "contact.far_field",
        "contact.spacing",
    ]
    yielding = load("paper-yielding")
    assert yielding.samples == 3000
    assert yielding.contact.hardness_limits == (0.003, 0.1)
    assert differences(paper, yielding) == [
        "contact.hardness_ratio[0]: nothing in the file, 0.003 asked for",
        "contact.hardness_ratio[1]: nothing in the file, 0.1 asked for",
    ]
    assert {
        line.partition("[")[0].partition(":")[0]
        for line in differences(paper, load("paper-nearest"))
    } == {
        *("surface.hurst", "delta.pieces", "contact.kernel"),
    }
    extreme = load("extreme")
    assert extreme.samples == 256
    assert extreme.surface.hurst == (0.01, 0.99)
    assert extreme.surface.sigma0 == (0.0, 1000.0)


def test_grid_follows_from_the_scene() -> None:
    assert load("paper").spacing == (1000.0 / 128,) * 2
    assert load("paper-mirco").spacing == (1000.0 / 129,) * 2
    assert Scene.parse("samples = 11\nsamples_per_surface = 5", "").surfaces == 3
    assert Scene.parse("samples = 10\nsamples_per_surface = 5", "").surfaces == 2


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_a_patch_without_edges_has_2_k_cells_of_the_length_over_their_number(boundary) -> None:
    scene = Scene.parse(f"samples = 1\n[contact]\nboundary = '{boundary}'", "some.toml")
    assert scene.contact.spacing == "side/n"
    assert scene.shape == (128, 128)
    assert scene.spacing == (1000.0 / 128,) * 2 == load("paper").spacing
    assert differences(load("paper"), scene) == [
        "contact.spacing: 'side/(n-1)' in the file, 'side/n' asked for",
        f"contact.boundary: nothing in the file, '{boundary}' asked for",
    ]
    assert Scene.from_text(scene.text()) == scene
    assert scene == Scene.parse(
        f"samples = 1\n[contact]\nspacing = 'side/n'\nboundary = '{boundary}'", ""
    )


def test_a_free_boundary_is_as_good_as_none() -> None:
    free = Scene.parse("samples = 15878\n[contact]\nboundary = 'free'", "some.toml")
    assert free.fingerprint() == load("paper").fingerprint()
    assert "boundary" not in free.text()
    mirco = Scene.parse("samples = 1\n[contact]\nboundary = 'free'\nspacing = 'side/n'", "")
    assert mirco.spacing == (1000.0 / 129,) * 2
    assert mirco.shape == (129, 129)


def test_load_reads_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for content in (b"samples = 3\r\n", b"\xef\xbb\xbfsamples = 3"):
        Path("mine.toml").write_bytes(content)
        assert load("mine.toml").samples == 3
        assert load(f"{tmp_path}/mine.toml").samples == 3
    Path("scene").write_text("samples = 4")
    assert load("scene").samples == 4
    Path("quick").mkdir()
    assert load("quick").samples == 256


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("quikc", "neither a file nor a preset"),
        ("nowhere.toml", "neither a file nor a preset"),
        ("./quick", "neither a file nor a preset"),
        ("folder", "directory"),
        ("", "directory"),
        ("binary.toml", "not UTF-8 text (byte 3 is 0xff)"),
        ("null\0.toml", "null"),
        ("line\nbreak.toml", "neither a file nor a preset"),
        ("n" * 5000, "too long"),
    ],
)
def test_unreadable_scene_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, reason: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("binary.toml").write_bytes(b"a =\xff")
    with pytest.raises(InputError) as refused:
        load(name)
    message = str(refused.value)
    assert len(message.splitlines()) == 1
    assert reason in message
    assert "extreme, fine, paper, paper-mirco, paper-nearest, paper-yielding, quick" in message
    assert "path" in message


@pytest.mark.parametrize("text", ["", "{", "[1]", "null", "3", '{"samples": NaN}', "[" * 100_000])
def test_text_that_is_no_scene_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(InputError) as refused:
        Scene.from_text(text, "some.h5")
    assert len(str(refused.value).splitlines()) == 1
    assert str(refused.value).startswith("some.h5: ")


finite = st.floats(0.0, 1e300)


def ascending(numbers: st.SearchStrategy[float]) -> st.SearchStrategy[list[float]]:
    return st.lists(numbers, min_size=2, max_size=2).map(sorted)


@st.composite
def materials(draw: st.DrawFn) -> dict[str, Any]:
    """The modulus, perhaps a hardness, and a far field and a boundary that go with it."""
    hardness = draw(st.sampled_from(["", "hardness", "hardness_ratio"]))
    if draw(st.booleans()):
        boundary = draw(st.sampled_from(["periodic", "mirror"]))
        cells = {"kernel": "uniform-pressure", "spacing": "side/n"}
        return {"far_field": "rigid", "boundary": boundary, **cells}
    if not hardness:
        return {
            "far_field": draw(st.sampled_from(["rigid", "compliant"])),
            "modulus": draw(st.floats(0.0, 1e300, exclude_min=True)),
        }
    positive = st.floats(1e-100, 1e100)
    return {
        "far_field": "rigid",
        "modulus": draw(positive),
        hardness: draw(st.one_of(positive, st.lists(positive, min_size=2, max_size=2).map(sorted))),
    }


@st.composite
def scenes(draw: st.DrawFn) -> dict[str, Any]:
    """The content of a valid scene with every key."""
    weights = draw(st.lists(st.integers(1, 1000), min_size=1, max_size=5))
    return {
        "title": draw(st.text(st.characters(exclude_categories=["Cs"]))),
        "samples": draw(st.integers(1, 10**9)),
        "samples_per_surface": draw(st.integers(1, 10_000)),
        "seed": draw(st.integers(0, 2**63 - 1)),
        "surface": {
            "generator": draw(st.sampled_from(["diamond-square", "midpoint"])),
            "nodes": 2 ** draw(st.integers(1, 12)) + 1,
            "side": draw(st.floats(0.0, 1e300, exclude_min=True)),
            "hurst": draw(ascending(st.floats(0.0, 1.0))),
            "sigma0": draw(ascending(finite)),
            "against": "another",
        },
        "delta": {
            "pieces": [
                {"share": weight / sum(weights), "range": draw(ascending(finite))}
                for weight in weights
            ]
        },
        "contact": {
            "kernel": draw(st.sampled_from(["uniform-pressure", "concentrated-force"])),
            "spacing": draw(st.sampled_from(["side/(n-1)", "side/n"])),
            **draw(materials()),
            "poisson": draw(st.floats(-1.0, 0.5, exclude_min=True)),
            "rtol": draw(st.floats(1e-14, 1.0, exclude_min=True, exclude_max=True)),
            "max_iterations": draw(st.integers(1, 1_000_000)),
        },
        "store": {name: draw(st.booleans()) for name in FULL["store"]},
    }


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(content=scenes())
def test_valid_scenes_survive_their_text(content: dict[str, Any]) -> None:
    scene = Scene.parse(tomli_w.dumps(content), "some.toml")
    again = Scene.from_text(scene.text())
    assert again == scene
    assert again.text() == scene.text()
    assert again.fingerprint() == scene.fingerprint()
    assert differences(scene, again) == []
    assert len(scene.text().splitlines()) == 1


WRONG_EVERYWHERE: list[object] = [[], [[1.0]], {"share": 1.0}, math.nan, -math.inf, -2, -1.5]
"""Values that no key of a scene accepts."""


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(content=scenes(), data=st.data())
def test_corrupted_scenes_are_refused_in_one_line(
    content: dict[str, Any], data: st.DataObject
) -> None:
    table = content
    dotted = ""
    while True:
        key = data.draw(st.sampled_from(sorted(table)))
        dotted += key
        if not isinstance(table[key], dict) or data.draw(st.booleans()):
            break
        table, dotted = table[key], dotted + "."
    wrong = data.draw(st.sampled_from(WRONG_EVERYWHERE))
    if data.draw(st.booleans()):
        table[key] = wrong
    else:
        dotted += data.draw(st.text("abc_", min_size=1).map("_{}_".format))
        table[dotted.rpartition(".")[2]] = wrong
    message = refusal(tomli_w.dumps(content))
    assert dotted in message


def test_fingerprint_ignores_what_changes_no_result() -> None:
    plain = Scene.parse("samples = 5\n[contact]\nrtol = 1e-8\nmodulus = 2\n", "a")
    other = Scene.parse(
        "# a comment\ntitle = 'text'\nsamples = 500\ncontact.modulus = 2.0\n"
        "contact.rtol = 0.00000001 # the same\n[surface]\nnodes = 129\n",
        "b",
    )
    assert plain.fingerprint() == other.fingerprint()
    assert differences(plain, other) == []
    zeros = Scene.parse("samples = 1\n[contact]\npoisson = -0.0", "a")
    assert zeros.fingerprint() == Scene.parse("samples = 1", "b").fingerprint()
    assert len(plain.fingerprint()) == 64


OTHER_VALUES = {
    "samples_per_surface": 5,
    "seed": 2026,
    "surface.generator": "midpoint",
    "surface.nodes": 257,
    "surface.side": 1000.0000000001,
    "surface.hurst": [0.5, 0.7],
    "surface.sigma0": [9.0, 15.0],
    "delta.pieces": [{"share": 1.0, "range": [5.0, 45.0]}],
    "contact.kernel": "concentrated-force",
    "contact.far_field": "compliant",
    "contact.spacing": "side/n",
    "contact.modulus": 2.0,
    "contact.poisson": 0.3,
    "contact.rtol": 1e-8,
    "contact.max_iterations": 999,
    "contact.hardness": 2000.0,
    "contact.hardness_ratio": [0.003, 0.1],
    "store.mean_gap": True,
    "store.largest_pressure": True,
    "store.perimeter": True,
    "store.heights": True,
    "store.pressure": True,
    "store.stiffness": True,
    "store.interface_stiffness": True,
    "store.contact_spots": True,
    "store.largest_spot_percent": True,
    "store.contact_connects": True,
    "store.gap_connects": True,
    "store.continuum_area_percent": True,
}


def test_other_values_cover_every_relevant_key() -> None:
    keys = {
        f"{table}.{key}" if isinstance(value, dict) else table
        for table, value in FULL.items()
        for key in (value if isinstance(value, dict) else [""])
    }
    unset = {"contact.boundary", "contact.hardness", "contact.hardness_ratio"}
    unset |= {f"store.{name}" for name in flags()} - keys  # the later ones are absent where off
    assert not keys & unset
    untested = {"title", "samples", "contact.boundary"}  # a boundary takes the spacing with it
    assert (keys | unset) - set(OTHER_VALUES) == untested


@pytest.mark.parametrize("key", OTHER_VALUES)
def test_fingerprint_changes_with_every_relevant_key(key: str) -> None:
    paper = load("paper")
    other = Scene.parse(tomli_w.dumps(changed(key, OTHER_VALUES[key])), "some.toml")
    assert other.fingerprint() != paper.fingerprint()
    lines = differences(paper, other)
    assert lines
    for line in lines:
        assert line.startswith(key)
        assert " in the file, " in line
        assert line.endswith(" asked for")


def test_unset_keys_are_neither_in_the_text_nor_in_the_fingerprint() -> None:
    """Another fingerprint here means that no database made so far can be continued."""
    paper = load("paper")
    assert "hardness" not in paper.text()
    fingerprint = "5ac8e0d743b06f1d8e1b890bdd15194df9e430ce5df0f5f5e560ccf0125b6de9"
    assert paper.fingerprint() == fingerprint


@pytest.mark.parametrize(
    ("keys", "limits", "columns"),
    [
        ("", None, set()),
        ("hardness = 2000", (2000.0, 2000.0), {"yielded_percent"}),
        ("hardness = [500, 2000]", (500.0, 2000.0), {"yielded_percent", "hardness"}),
        ("modulus = 3.0\npoisson = 0.5\nhardness_ratio = 0.5", (2.0, 2.0), {"yielded_percent"}),
        (
            "modulus = 3.0\npoisson = 0.5\nhardness_ratio = [0.5, 1]",
            (2.0, 4.0),
            {"yielded_percent", "hardness"},
        ),
    ],
)
def test_a_hardness_is_a_number_or_a_range_in_mpa_or_in_e_star(keys, limits, columns) -> None:
    scene = Scene.parse(f"samples = 1\n[contact]\n{keys}", "some.toml")
    assert scene.contact.hardness_limits == limits
    assert scene.optional_columns == columns | {"hurst", "sigma0"}


def test_differences_read_like_sentences() -> None:
    paper = load("paper")
    steel = Scene.parse("samples = 1\n[contact]\nhardness = 2000", "some.toml")
    assert differences(paper, steel) == ["contact.hardness: nothing in the file, 2000.0 asked for"]
    strict = Scene.parse(tomli_w.dumps(changed("contact.rtol", 1e-8)), "some.toml")
    assert differences(paper, strict) == ["contact.rtol: 2e-07 in the file, 1e-08 asked for"]
    single = Scene.parse(tomli_w.dumps(changed("delta.pieces", OTHER_VALUES["delta.pieces"])), "")
    assert differences(paper, single) == [
        "delta.pieces[0].share: 0.75 in the file, 1.0 asked for",
        "delta.pieces[0].range[1]: 25.0 in the file, 45.0 asked for",
        "delta.pieces[1].share: 0.25 in the file, nothing asked for",
        "delta.pieces[1].range[0]: 25.0 in the file, nothing asked for",
        "delta.pieces[1].range[1]: 45.0 in the file, nothing asked for",
    ]


def test_scenes_are_immutable() -> None:
    with pytest.raises(ValueError, match="frozen"):
        load("quick").seed = 3


def test_import_brings_no_solver() -> None:
    code = (
        "import sys, gen.scene; gen.scene.load('quick'); "
        "print(*{'scipy', 'h5py', 'mpi4py', 'pyfftw'} & set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.split() == []


DEEP = {
    "bare keys": "samples = 3\n" + "a." * 200_000 + "b = 1",
    "a table": "samples = 3\n[" + "a." * 200_000 + "b]",
    "quoted keys": "samples = 3\n" + '"a" . ' * 100_000 + "b = 1",
    "arrays": "samples = " + "[" * 200_000,
    "inline tables": "samples = " + "{a=" * 100_000,
}
ENDLESS = {
    "texts": "samples = 3\ntitle = " + '"""\n\\' * 30_000,
    "quotes": 'samples = 3\ntitle = "' + 'x\\"' * 50_000,
}


@pytest.mark.parametrize("text", [*DEEP.values(), *ENDLESS.values()], ids=[*DEEP, *ENDLESS])
def test_no_text_keeps_the_parser_busy(text: str) -> None:
    began = time.process_time()
    refused = refusal(text)
    assert time.process_time() < began + 2.0
    assert ("over 16 levels" if text in DEEP.values() else "not TOML") in refused


def test_dots_and_brackets_in_texts_and_comments_are_no_depth() -> None:
    text = 'samples = 3 # [[[[[[[[[[[[[[[[[[ a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r\ntitle = "{}"\n'
    title = "." * 20 + "[" * 20
    assert Scene.parse(text.format(title), "test").title == title


def test_a_file_of_over_a_megabyte_is_no_scene(tmp_path: Path) -> None:
    path = tmp_path / "large.toml"
    path.write_text("samples = 3\n" + "#" * 1_000_000)
    with pytest.raises(InputError, match="over 1,000,000 bytes"):
        load(str(path))


@pytest.mark.parametrize("per_surface", [1, 10_000])
def test_the_plan_of_a_billion_rows_takes_no_time(per_surface: int) -> None:
    began = time.process_time()
    text = f"samples = {{}}\nsamples_per_surface = {per_surface}"
    scenes = [Scene.parse(text.format(samples), "test") for samples in (10**9, 10**6)]
    large, counted = map(planned_loads, scenes)
    assert time.process_time() < began + 2.0
    assert scenes[0].surfaces == 10**9 // per_surface
    assert large == pytest.approx(counted, rel=1e-3)


PAPER = (files("gen") / "scenes" / "paper.toml").read_text(encoding="utf-8")
INSTEAD = re.findall(r"^# (\[\w+\]\n(?:# \w.*\n|#  .*\n)+)", PAPER, flags=re.MULTILINE)
"""Tables that stand in comments of the paper's scene, in place of those that it has."""


@pytest.mark.parametrize("block", INSTEAD, ids=["spectral", "scans", "python", "load"])
def test_tables_in_comments_are_scenes(block: str) -> None:
    needed = INSTEAD[-1] if "scans" in block else ""
    text = re.sub(r"^# ?", "", block + needed, flags=re.MULTILINE)
    scene = Scene.parse(f"samples = 3\n{text}", "comments")
    assert scene.fingerprint() != load("paper").fingerprint()


def test_the_papers_scene_names_every_key() -> None:
    """But for those that a run writes itself."""
    tables = [Scene, Load, Delta, Piece, Contact, Store, *TAGS.values()]
    keys = {name for table in tables for name in table.model_fields} - {
        "source",
        "found",
        "against_found",
    }
    assert {key for key in keys if not re.search(rf"\b{key}\b( =|\])", PAPER)} == set()


GENERATED = st.fixed_dictionaries(
    {},
    optional={
        "generator": st.sampled_from(["spectral", "python", "midpoint", "scans", 3]),
        "nodes": st.sampled_from([1, 8, [8], [8, 9], [8, 9, 10], "8", 8.0, [8, True], 5000]),
        "side": st.sampled_from([0, -1.0, [1.0, 2.0], [1.0], "1", True, [1.0, math.inf]]),
        "roll_off": st.deferred(lambda: numbers),
        "cut_off": st.deferred(lambda: numbers),
        "rms_height": st.deferred(lambda: numbers),
        "rms_slope": st.deferred(lambda: numbers),
        "hurst": st.deferred(lambda: numbers),
        "stretch": st.deferred(lambda: numbers),
        "period": st.sampled_from([0.5, 17, "2", True, [1, 2]]),
        "function": st.sampled_from(
            ["", "a", "a:", ":b", "a:b:c", "a b:c", "no_module:f", 3, "a:b"]
        ),
        "parameters": st.sampled_from(
            [3, {"A": 1}, {"a": "b"}, {"a": {}}, {"force": 1.0}, {"a" * 41: 1}, {"a b": 2}, [1]]
        ),
        "source": st.sampled_from(["", "0" * 63, "G" * 64, 5]),
        "against": st.sampled_from(["itself", 3, True]),
        "sigma": st.just(1),
        "files": st.sampled_from(["no_such_folder/*", [], 3, [3], "", ["a", ""]]),
        "reading": st.sampled_from([3, {"units": "nm"}, {"unit": 3}, {"side": 0}]),
        "preparation": st.sampled_from([3, {"level": "cubic"}, {"form": 0}, {"despike": "7"}]),
        "spacing": st.deferred(lambda: numbers),
    },
)
numbers = st.sampled_from(
    [
        *(-1, "1", True, [], [1], [2, 1], [1, 2, 3], [0, math.inf], math.nan, [1, "2"], {}, 1e400),
        *({"uniform": [1, 2]}, {"normal": [1, 0]}, {"normal": [1]}, {"normal": [0, 1], "rang": 1}),
        *({"normal": [0, 1], "range": [40, 50]}, {"log_uniform": [0, 1]}, {"choice": []}),
        *({"choice": [1, 2], "shares": [1]}, {"choice": [1], "normal": [1, 2]}, {"choice": 5}),
        *({"log_uniform": [2, 1]}, {"normal": [-5, 1]}, {"choice": [1, "2"]}, [[1, 2], [3, 4]]),
    ]
)
LOADED = st.fixed_dictionaries(
    {},
    optional={
        "quantity": st.sampled_from(["delta", "Pressure", "", 5, ["force"], "pressure"]),
        "range": numbers,
        "pieces": st.sampled_from(
            [[], 5, [5], [{}], [{"share": 1}], [{"share": 0.5, "range": 1}], {"share": 1}]
        ),
        "unit": st.just("MPa"),
    },
)
STORED = st.fixed_dictionaries(
    {},
    optional={
        "function": st.sampled_from(["a", 3, "a:b c", "", "no_module:f"]),
        "outputs": st.sampled_from(
            [{}, 3, {"A": "um"}, {"a": 3}, {"a": ""}, {"a": "u" * 30}, {"a": "\n"}, ["a"]]
        ),
        "source": st.sampled_from(["", 5, "x" * 64]),
        "mean_gap": st.sampled_from([1, "yes"]),
        "spots": st.just(True),
    },
)
SCENES = st.fixed_dictionaries(
    {"samples": st.just(2)},
    optional={
        "surface": GENERATED,
        "load": LOADED,
        "delta": st.just({}),
        "store": STORED,
        "contact": st.fixed_dictionaries({}, optional={"hardness": numbers, "boundary": numbers}),
    },
)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(SCENES)
def test_bad_scenes_are_refused_in_one_line(content: dict[str, Any]) -> None:
    """Every key of these tables that is given has a value that is not allowed, or nearly so."""
    try:
        text = tomli_w.dumps(content)
    except (ValueError, TypeError):
        return
    try:
        completed(Scene.parse(text, "some.toml"))
    except InputError as error:
        message = str(error)
        assert len(message.splitlines()) == 1
        assert message.isprintable()
        assert len(message) < 1200
    else:
        given_keys = {name: table for name, table in content.items() if table}
        assert given_keys in ({"samples": 2}, {"samples": 2, "surface": {"generator": "midpoint"}})


DRAWN = st.one_of(
    st.floats(20, 60),
    st.tuples(st.floats(20, 30), st.floats(31, 60)).map(list),
    st.just({"log_uniform": [20.0, 60.0]}),
    st.just({"normal": [40.0, 5.0]}),
    st.just({"normal": [40.0, 9.0], "range": [30.0, 41.0]}),
    st.just({"choice": [20.0, 40, 21.5], "shares": [0.5, 0.25, 0.25]}),
)
GOOD = st.fixed_dictionaries(
    {
        "samples": st.integers(1, 99),
        "surface": st.one_of(
            st.fixed_dictionaries(
                {
                    "generator": st.just("spectral"),
                    "roll_off": st.just(80.0),
                    "cut_off": DRAWN,
                    "rms_height": DRAWN,
                },
                optional={"stretch": st.just([1.0, 1.2]), "nodes": st.just([200, 300])},
            ),
            st.fixed_dictionaries(
                {"generator": st.just("python"), "function": st.just("package.mine:waves")},
                optional={
                    "parameters": st.dictionaries(st.sampled_from("zbca"), DRAWN),
                    "side": st.sampled_from([5, 7.5, [3, 4.0]]),
                    "against": st.just("another"),
                },
            ),
        ),
    },
    optional={
        "load": st.fixed_dictionaries({"quantity": st.sampled_from(list(UNITS)), "range": DRAWN}),
        "contact": st.fixed_dictionaries({"hardness": DRAWN}),
        "store": st.fixed_dictionaries(
            {"function": st.just("mine:spots")},
            optional={
                "outputs": st.dictionaries(st.sampled_from("zab"), st.just("um"), min_size=1)
            },
        ),
    },
)


@settings(max_examples=100, deadline=None)
@given(GOOD, st.randoms(use_true_random=False))
def test_the_text_of_a_scene_is_that_scene_in_any_order_of_its_keys(content, random) -> None:
    """Numbers, distributions, parameters and outputs; whole numbers are numbers like others."""
    try:
        scene = Scene.parse(tomli_w.dumps(content), "good")
    except InputError as error:  # a load that no hardness drawn here carries
        assert "carries less" in str(error)  # noqa: PT017
        return
    again = Scene.from_text(scene.text())
    assert again == scene
    assert again.text() == scene.text()
    assert again.fingerprint() == scene.fingerprint()
    assert differences(again, scene) == []
    assert Scene.parse(tomli_w.dumps(shuffled(content, random)), "other") == scene
    assert [column.name for column in columns_for(again)] == [
        column.name for column in columns_for(scene)
    ]


def shuffled(value: Any, random: Any) -> Any:
    """The same tables with their keys in another order."""
    if not isinstance(value, dict):
        return value
    keys = list(value)
    random.shuffle(keys)
    return {key: shuffled(value[key], random) for key in keys}


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_spacings_follow_the_rule_of_the_solver(boundary: Boundary) -> None:
    """Scenes follow it without loading the solver, also on grids of two nodes."""
    keys = "roll_off = 90.0\ncut_off = 85.0\nrms_height = 1.0\nnodes = [2, 7]\nside = [40.0, 90.0]"
    text = f"samples = 1\n[surface]\ngenerator = 'spectral'\n{keys}\nperiod = 4.0\n"
    scene = Scene.parse(f"{text}[contact]\nboundary = '{boundary}'", "test")
    expected = node_spacing(2, 40.0, boundary), node_spacing(7, 90.0, boundary)
    assert scene.spacing == expected
    code = f"from gen.scene import Scene; print(Scene.parse({text!r}, 'a').spacing);"
    code += "import sys; print('bem' in sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert loaded.stdout.splitlines()[1] == "False"


def test_parameters_nodes_and_seed_can_be_given_and_nothing_else_changes():
    scene = Scene.parse("samples = 3\n[surface]\nhurst = [0.2, 0.9]\nnodes = 17\n", "test")
    assert scene.with_parameters({}) == scene
    given = scene.with_parameters({"hurst": 0.4}, nodes=33, seed=7)
    assert given.drawn_parameters == {"hurst": 0.4, "sigma0": scene.drawn_parameters["sigma0"]}
    assert (given.shape, given.seed) == ((33, 33), 7)
    assert given.contact == scene.contact
    for wrong in ({"hurst": 1.5}, {"hirst": 0.5}, {"sigma0": math.nan}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            scene.with_parameters(wrong)
