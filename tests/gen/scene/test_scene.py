"""Scenes: what is read, what is refused and how, and what makes two scenes the same."""

import inspect
import json
import re
import time
from importlib.resources import files
from pathlib import Path

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st
from launch import python

from bem.problem import BOUNDARIES, MAX_ITERATIONS, RTOL, node_spacing
from gen import cli
from gen.generation.forecast import planned_loads
from gen.generators import GENERATORS, TAGS
from gen.quantities import stored_quantities
from gen.runtime.errors import InputError
from gen.scene import Piece, Scene, Store, differences, load
from gen.scene.accuracy import Accuracy
from gen.scene.tables import Contact, Delta, Load


def test_the_solvers_defaults_are_the_same_everywhere():
    """Scenes and commands are read without the solver, whose import takes most of their time."""
    command = inspect.signature(cli.contact).parameters
    for name, default in (("rtol", RTOL), ("max_iterations", MAX_ITERATIONS)):
        assert getattr(load("paper").contact, name) == default
        assert Scene.parse("samples = 1", "a").contact.model_dump()[name] == default
        assert command[name].default == default


def refusal(text):
    """The one line with which a scene's TOML is refused."""
    with pytest.raises(InputError) as refused:
        Scene.parse(text, "some.toml")
    message = str(refused.value)
    assert len(message.splitlines()) == 1
    assert message.isprintable()
    assert message.startswith("some.toml: ")
    return message


SPECTRAL = "samples = 3\n[surface]\ngenerator = 'spectral'\nroll_off = 90\nnodes = 20\nside = 90\n"
PRESSURE = "samples = 3\n[load]\nquantity = 'pressure'\n"
PIECES = "one or more { share = ..., range = [low, high] }, their shares sum to 1"
BAD_SCENES = [
    ("samples = true", ["samples = true;", "a whole number"]),
    ("samples = 0x" + "f" * 6000, ["samples = a number of thousands of digits;"]),
    ("seed = 1", ["samples is missing", "the number of rows"]),
    ("sample = 10", ["unknown key sample = 10;", "closest known key is samples"]),
    (
        "samples = 1\n[surface]\nrtol = 1e-3",
        ["unknown key surface.rtol = 0.001;", "contact.rtol"],
    ),
    (
        "samples = 1\n[surface]\nhurst = [0.5, 1.5]",
        ["surface.hurst = [0.5, 1.5];", "high <= 1"],
    ),
    (
        "samples = 1\n[surface]\ngenerator = 'fractal'",
        ["'fractal'", "'diamond-square', 'midp"],
    ),
    ("samples = 1\ndelta.pieces = [7]", ["delta.pieces[0] = 7;", PIECES]),
    (
        "samples = 1\ndelta.pieces = [{share=0.5, range=[1, 2]}, {share=0.4, range=[1, 2]}]",
        ["delta.pieces = [{", PIECES, "(the shares sum to 0.9)"],
    ),
    (
        "samples = 1\ndelta.pieces = [{share = 1.0, range = [5, 1]}]",
        ["delta.pieces[0].range = [5, 1];", "low <= high", "(5.0 is above 1.0)"],
    ),
    ("samples = 1\nsurface.hurst = { log = [1, 2] }", ["give one of the keys"]),
    (
        "samples = 1\n[contact]\nhardness = inf",
        ["contact.hardness = inf;", "finite", "[MPa]"],
    ),
    (
        "samples = 1\n[contact]\nhardness = 2000\nhardness_ratio = 0.01",
        ["contact: hardness [MPa] and hardness_ratio [E*] are both given: give one"],
    ),
    (
        "samples = 1\n[contact]\nboundary = 'mirror'\nspacing = 'side/(n-1)'",
        ["contact: boundary = 'mirror' needs spacing = 'side/n', not 'side/(n-1)'"],
    ),
    (
        "samples = 0\nseed = -1\n[contact]\nrtol = 2",
        ["samples = 0;", "from 1", "(and 2 more)"],
    ),
    (
        'samples = 1\n"a\\nb\u2028" = "c\\u001b[31m"',
        ["unknown key a?b? = ", "keys of a scene are"],
    ),
    ("samples = 1\nseeds = 5\ntitles = 'a'", ["key is seed", "(and 1 more)"]),
    ("samples = 1\nseed 5", ["not TOML", "line 2"]),
    (
        "samples = 1\n[delta]\n[load]\nquantity = 'force'\nrange = 5",
        ["[delta] and [load]"],
    ),
    (
        "samples = 1\n[load]\nquantity = 'force'\nrange = 5\n[contact]\nfar_field = 'compliant'",
        ["'force' needs contact.far_field = 'rigid'"],
    ),
    (f"{SPECTRAL}cut_off = 20.0", ["give either rms_height or rms_slope"]),
    (f"{SPECTRAL}cut_off = 95.0\nrms_height = 1.0", ["the shorter wavelength"]),
    (
        f"{SPECTRAL}cut_off = 20.0\nrms_height = {{ normal = [1.0, 1.0] }}",
        ["are -2 to 4"],
    ),
    (
        "samples = 3\nsurface.hurst = { choice = [0, 1], shares = [0.5, 0.6] }",
        ["sum to 1.1"],
    ),
    ("samples = 3\n[surface]\nsigma0 = { log_uniform = [1e-320, 1e308] }", ["too wide"]),
    ("samples = 3\n[surface]\ngenerator = 'python'", ["surface.function is missing"]),
    (f"{PRESSURE}range = 1.0\npieces = [{{share = 1.0, range = 1.0}}]", ["both given"]),
    (PRESSURE, ["load.pieces is missing; allowed: range = [low, high], or pieces"]),
    (
        f"{PRESSURE}range = [5.0, 6.0]\n[contact]\nhardness = [3.0, 5.0]",
        ["less than 5 MPa"],
    ),
    ("samples = 3\n[store]\noutputs = { a = '1' }", ["needs function"]),
]


@pytest.mark.parametrize(
    ("text", "parts"),
    BAD_SCENES,
    ids=[text[:50].encode("unicode_escape").decode() for text, _ in BAD_SCENES],
)
def test_refusal_names_key_value_and_what_is_allowed(text, parts):
    message = refusal(text)
    for part in parts:
        assert part in message


@pytest.mark.parametrize("content", [b"samples = 3\r\n", b"\xef\xbb\xbfsamples = 3"])
def test_load_reads_files_of_any_editor(here, content):
    Path("mine.toml").write_bytes(content)
    assert load("mine.toml").samples == 3
    assert load(f"{here}/mine.toml").samples == 3


@pytest.mark.usefixtures("here")
def test_load_reads_a_file_without_a_suffix():
    Path("scene").write_text("samples = 4")
    assert load("scene").samples == 4


@pytest.mark.usefixtures("here")
def test_the_name_of_a_preset_takes_precedence():
    Path("quick").mkdir()
    assert load("quick").samples == 256


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("quikc", "neither a file nor a preset"),
        ("folder", "directory"),
        ("large.toml", "at most 200000 are read"),
        ("binary.toml", "not UTF-8 text (byte 3 is 0xff)"),
    ],
)
def test_unreadable_scene_is_refused_in_one_line(name, reason):
    Path("folder").mkdir()
    Path("binary.toml").write_bytes(b"a =\xff")
    Path("large.toml").write_text("samples = 3\n" + "#" * 200_000)
    with pytest.raises(InputError) as refused:
        load(name)
    message = str(refused.value)
    assert len(message.splitlines()) == 1
    assert reason in message
    assert (
        "extreme, fine, paper, paper-mirco, paper-nearest, paper-yielding, quick"
        in message
    )
    assert "path" in message


PLAIN = "samples = 5\n[contact]\nrtol = 1e-8\nmodulus = 2\n"
SAME_RESULTS = """# a comment
title = 'text'
samples = 500
contact.modulus = 2.0
contact.rtol = 0.00000001 # the same
[surface]
nodes = 129
"""
"""A scene that has the same rows as `PLAIN`, and more of them."""


def test_a_fingerprint_is_a_sha256():
    assert re.fullmatch("[0-9a-f]{64}", Scene.parse(PLAIN, "a").fingerprint())


def test_fingerprint_ignores_what_changes_no_result():
    plain = Scene.parse(PLAIN, "a")
    assert plain.fingerprint() == Scene.parse(SAME_RESULTS, "b").fingerprint()


def test_scenes_with_the_same_results_have_no_differences():
    assert differences(Scene.parse(PLAIN, "a"), Scene.parse(SAME_RESULTS, "b")) == []


def test_fingerprint_ignores_the_sign_of_zero():
    zeros = Scene.parse("samples = 1\n[contact]\npoisson = -0.0", "a")
    assert zeros.fingerprint() == Scene.parse("samples = 1", "b").fingerprint()


RELEVANT = [
    "seed = 2026",
    "surface.side = 1000.0000000001",
    "delta.pieces = [{ share = 1.0, range = [5.0, 45.0] }]",
    "contact.hardness_ratio = [0.003, 0.1]",
    "store.gap_connects = true",
]
"""Keys that change results of the paper's scene."""


def test_the_papers_values_are_the_defaults():
    paper = load("paper")
    assert Scene.parse("samples = 1", "a").fingerprint() == paper.fingerprint()


@pytest.mark.parametrize("line", RELEVANT)
def test_fingerprint_changes_with_every_relevant_key(line):
    other = Scene.parse(f"samples = 1\n{line}", "some.toml")
    assert other.fingerprint() != load("paper").fingerprint()


@pytest.mark.parametrize("line", RELEVANT)
def test_differences_name_the_key_and_both_values(line):
    key = line.partition(" ")[0]
    other = Scene.parse(f"samples = 1\n{line}", "some.toml")
    lines = differences(load("paper"), other)
    assert lines
    for difference in lines:
        assert difference.startswith(key)
        assert " in the file, " in difference
        assert difference.endswith(" asked for")


def test_differences_say_where_the_values_stand():
    scenes = [Scene.parse(f"samples = 1\nseed = {seed}", "a") for seed in (1, 2)]
    assert differences(*scenes, ("in a.h5", "in b.h5")) == ["seed: 1 in a.h5, 2 in b.h5"]


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


@pytest.mark.parametrize(
    "text", [*DEEP.values(), *ENDLESS.values()], ids=[*DEEP, *ENDLESS]
)
def test_no_text_keeps_the_parser_busy(text):
    start = time.process_time()
    message = refusal(text)
    assert time.process_time() < start + 20.0
    assert "not TOML" in message


def test_dots_and_brackets_in_texts_and_comments_are_no_depth():
    title = "." * 20 + "[" * 20
    assert (
        Scene.parse(f'samples = 3 # {title}\ntitle = "{title}"\n', "test").title == title
    )


@pytest.mark.parametrize("per_surface", [1, 10_000])
def test_the_plan_of_a_billion_rows_takes_no_time(per_surface):
    start = time.process_time()
    text = f"samples = {{}}\nsamples_per_surface = {per_surface}"
    scenes = [Scene.parse(text.format(samples), "test") for samples in (10**9, 10**6)]
    large, counted = map(planned_loads, scenes)
    assert time.process_time() < start + 20.0
    assert scenes[0].surfaces == 10**9 // per_surface
    assert large == pytest.approx(counted, rel=1e-3)


PAPER = (files("gen") / "scenes" / "paper.toml").read_text(encoding="utf-8")
INSTEAD = re.findall(r"^# (\[\w+\]\n(?:# \w.*\n|#  .*\n)+)", PAPER, flags=re.MULTILINE)
"""Tables that stand in comments of the paper's scene, in place of those that it has."""


def name_of(block):
    """Name of a block's generator, or of its table if it is another one than [surface]."""
    generator = re.search(r'^# generator = "(.+?)"', block, flags=re.MULTILINE)
    return generator[1] if generator else re.match(r"\[(\w+)\]", block)[1]


BLOCKS = {name_of(block): block for block in INSTEAD}
SPECTRAL_BLOCK, LOAD_BLOCK = BLOCKS["spectral"], BLOCKS["load"]


def test_every_generator_stands_in_comments_of_the_papers_scene():
    """Apart from the first class, those of random midpoint displacement, which the scene has."""
    for table in GENERATORS[1:]:
        assert BLOCKS.keys() & {*table.NAMES}, f"gen/scenes/paper.toml: {table.NAMES}"


@pytest.mark.parametrize("block", INSTEAD, ids=BLOCKS)
def test_tables_in_comments_are_scenes(block):
    needed = ""
    if "scans" in block or "like" in block:
        needed = LOAD_BLOCK
    if "[accuracy]" in block:
        needed = SPECTRAL_BLOCK
    text = re.sub(r"^# ?", "", block + needed, flags=re.MULTILINE)
    scene = Scene.parse(f"samples = 3\n{text}", "comments")
    assert scene.fingerprint() != load("paper").fingerprint()


def test_the_papers_scene_names_every_key():
    """But for those that a run writes itself, and further quantities, which `gen columns` lists."""
    tables = [Scene, Load, Delta, Piece, Contact, Accuracy, Store, *TAGS.values()]
    keys = {name for table in tables for name in table.model_fields}
    keys -= {"source", "powers", "found", "against_found"}
    keys -= {quantity.name for quantity in stored_quantities() if not quantity.early}
    assert {key for key in keys if not re.search(rf"\b{key}\b( =|\])", PAPER)} == set()


FULL_SCENES = re.split(
    "\n\n",
    """surface = { against = "another" }
contact = { hardness = [1.0, 2.0] }
store = { perimeter = true }

surface = { generator = "spectral", roll_off = 80.0, cut_off = 40.0, rms_slope = 0.1 }
load = { quantity = "force", range = { normal = [4.0, 0.5] } }

surface = { generator = "spectral", roll_off = 80.0, cut_off = 40.0, rms_slope = 0.1 }
accuracy = { continuum_area = 0.01, stiffness = 0.1 }

surface = { generator = "python", function = "a:b", parameters = { c = [1, 2] } }
store = { function = "a:d", outputs = { e = "um" }, least = { e = 0.0 } }

[surface]
generator = "scans"
files = "maps"
spacing = 1.0
reading = { side = 9 }
preparation = { level = "plane" }
[load]
quantity = "pressure"
range = 1.0
""",
)
JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=5), inner, max_size=2)
    ),
    max_leaves=5,
)


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(FULL_SCENES), JUNK, st.data())
def test_any_value_of_any_key_is_taken_or_refused_in_one_line(text, value, data):
    content = table = json.loads(Scene.parse(f"samples = 3\n{text}", "full").text())
    key = data.draw(st.sampled_from(sorted(table)))
    while isinstance(table[key], dict) and table[key] and data.draw(st.booleans()):
        table = table[key]
        key = data.draw(st.sampled_from(sorted(table)))
    table[key] = value
    message = "a.toml: "
    try:
        scene = Scene.from_text(json.dumps(content), "a.toml")
    except InputError as refused:
        message = str(refused)
    else:
        assert Scene.from_text(scene.text()) == scene
    assert message.startswith("a.toml: ")
    assert len(message) < 1200
    assert message.isprintable()


@pytest.mark.parametrize("text", FULL_SCENES)
def test_the_text_of_a_scene_is_that_scene(text):
    scene = Scene.parse(f"samples = 3\n{text}", "full")
    again = Scene.from_text(scene.text())
    assert again == scene
    assert again.text() == scene.text()
    assert differences(again, scene) == []


def reversed_keys(value):
    if not isinstance(value, dict):
        return value
    return {key: reversed_keys(value[key]) for key in reversed(value)}


@pytest.mark.parametrize("text", FULL_SCENES)
def test_the_order_of_keys_does_not_matter(text):
    scene = Scene.parse(f"samples = 3\n{text}", "full")
    content = reversed_keys(json.loads(scene.text()))
    other = Scene.parse(tomli_w.dumps(content), "other")
    assert other == scene
    assert other.fingerprint() == scene.fingerprint()


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_spacings_follow_the_rule_of_the_solver(boundary):
    """Also on grids of two nodes."""
    keys = "roll_off = 90.0\ncut_off = 85.0\nrms_height = 1.0\nnodes = [2, 7]\nside = [40.0, 90.0]"
    text = f"samples = 1\n[surface]\ngenerator = 'spectral'\n{keys}\nperiod = 4.0\n"
    scene = Scene.parse(f"{text}[contact]\nboundary = '{boundary}'", "test")
    expected = node_spacing(2, 40.0, boundary), node_spacing(7, 90.0, boundary)
    assert scene.spacing == expected


def test_the_solver_is_not_imported_for_spacings():
    code = "from gen.scene import Scene; Scene.parse('samples = 1', 'a').spacing;"
    code += "import sys; print('bem' in sys.modules)"
    assert python("-c", code).stdout.splitlines() == ["False"]
