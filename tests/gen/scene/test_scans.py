"""Tests of scenes of scans: their keys, their defaults, and what makes them another scene."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gen.maps.read import sides_from
from gen.runtime.errors import InputError
from gen.scene import ScanSurface, Scene, differences, load
from gen.scene.scans import Found, ScannedMap

SCANS = """samples = 10
[surface]
generator = "scans"
files = {files}
nodes = {nodes}
[surface.preparation]
level = "plane"
[load]
quantity = "pressure/(E* slope_rms)"
range = [0.01, 0.02]
"""


def scene(files='"maps"', nodes="[20, 30]", more=""):
    return Scene.parse(SCANS.format(files=files, nodes=nodes) + more, "a.toml")


def with_maps(made, *, folder="/here", spacing=(0.5, 0.5), sha256s=("a" * 64, "b" * 64)):
    maps = tuple(
        ScannedMap(file=f"{folder}/{n}", sha256=each, nodes=(90, 80 + n))
        for n, each in enumerate(sha256s)
    )
    found = Found(spacing=spacing, maps=maps)
    return made.model_copy(update={"surface": made.surface.model_copy(update={"found": found})})


def test_windows_are_mirrored_unless_the_scene_says_otherwise():
    assert scene().contact.boundary == "mirror"
    assert scene(more="[contact]\nmodulus = 7.0\n").contact.boundary == "mirror"
    for boundary in ("free", "periodic", "mirror"):
        given = scene(more=f"[contact]\nboundary = '{boundary}'\n")
        assert given.contact.boundary == boundary
        again = Scene.from_text(given.text())
        assert again == given
        assert again.fingerprint() == given.fingerprint()
    assert Scene.parse("samples = 1", "a").contact.boundary == "free"


def test_a_scene_with_its_maps_is_written_and_read():
    made = with_maps(scene())
    again = Scene.from_text(made.text())
    assert again == made
    assert isinstance(again.surface, ScanSurface)
    assert again.optional_columns >= {"map", "tile"}
    assert not again.drawn_parameters


@pytest.mark.parametrize(
    ("boundary", "sides"),
    [("mirror", (10.0, 24.0)), ("free", (9.5, 23.2)), ("periodic", (10.0, 24.0))],
)
def test_the_spacing_is_that_of_the_maps(boundary, sides):
    made = with_maps(scene(more=f"[contact]\nboundary = '{boundary}'\n"), spacing=(0.5, 0.8))
    assert made.shape == (20, 30)
    assert made.sides == pytest.approx(sides, rel=1e-12)
    assert made.spacing == pytest.approx((0.5, 0.8), rel=1e-12)


def test_nobody_knows_the_sides_before_the_maps_are_found():
    with pytest.raises(InputError, match="the maps of this scene have not been looked for"):
        _ = scene().sides


def test_moved_maps_are_the_same_scene_and_changed_ones_another():
    made = with_maps(scene())
    assert with_maps(scene('"elsewhere"'), folder="/there").fingerprint() == made.fingerprint()
    changed = with_maps(scene(), sha256s=("a" * 64, "c" * 64))
    (difference,) = differences(made, changed)
    old, new = f"'{'b' * 64}, 90 x 81'", f"'{'c' * 64}, 90 x 81'"
    assert difference == f"surface.found.maps[1]: {old} in the file, {new} asked for"
    (fewer, *_) = differences(made, with_maps(scene(), sha256s=("a" * 64,)))
    assert fewer == "surface.found.number: 2 in the file, 1 asked for"
    coarser = with_maps(scene(), spacing=(1.0, 1.0))
    assert coarser.fingerprint() != made.fingerprint()


def test_files_start_from_the_folder_of_the_scene(tmp_path):
    path = tmp_path / "folder" / "a.toml"
    path.parent.mkdir()
    path.write_text(SCANS.format(files='["maps", "/abs/*.x3p", "~/b.nc"]', nodes="9"))
    assert load(str(path)).surface.files == (f"{path.parent}/maps", "/abs/*.x3p", "~/b.nc")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('files = "maps"', "files = []", "surface.files = []; allowed: a file, a folder"),
        ('files = "maps"', "files = ['']", "surface.files = ['']; allowed: a file"),
        ('files = "maps"', "files = 3", "surface.files = 3; allowed: a file"),
        ('files = "maps"\n', "", "surface.files is missing; allowed: a file"),
        ("nodes = [20, 30]", "nodes = [20, 1]", "surface.nodes = [20, 1]; allowed: a whole"),
        ("nodes", "spacing = 0\nnodes", "surface.spacing = 0; allowed: a finite number above 0"),
        ("nodes", "hurst = 0.8\nnodes", "surface.hurst = 0.8 of this generator; it is one of"),
        ("nodes", "against = true\nnodes", "'another', for a second window of a tile, or maps"),
        ("nodes", "against = []\nnodes", "surface.against"),
        ('"plane"', '"flat"', "surface.preparation.level = 'flat'; allowed: 'mean', 'plane'"),
        ("level", "despike = 0\nlevel", "surface.preparation.despike = 0; allowed: a number above"),
        ("level", "form = 1.5\nlevel", "surface.preparation.form = 1.5; allowed: the degree"),
        ("level", "downsample = 1\nlevel", "surface.preparation.downsample = 1; allowed: a whole"),
        ("level", "despik = 7\nlevel", "key surface.preparation.despik = 7; the closest known"),
        (
            "[load]",
            "[surface.reading]\nunits = 'nm'\n[load]",
            "the closest known key is surface.re",
        ),
        ("[load]", "[surface.reading]\nside = [9, true]\n[load]", "side = [9, True]; allowed: the"),
        ("[load]", "[surface.reading]\nside = 0\n[load]", "side = 0; allowed: the scan length"),
        ("[load]", "[contact]\nfar_field = 'compliant'\n[load]", "needs far_field = 'rigid'"),
    ],
)
def test_faults_are_one_line(old, new, message):
    text = SCANS.format(files='"maps"', nodes="[20, 30]")
    assert old in text
    with pytest.raises(InputError) as refusal:
        Scene.parse(text.replace(old, new, 1), "a.toml")
    assert message in str(refusal.value)
    assert len(str(refusal.value).splitlines()) == 1


def test_scans_need_loads():
    text = SCANS[: SCANS.index("[load]")].format(files='"maps"', nodes="9")
    with pytest.raises(InputError, match=r"a.toml: surfaces of scans need loads: give \[load\]"):
        Scene.parse(text, "a.toml")


@pytest.mark.parametrize(
    ("given", "text"),
    [("99.0", "99"), ("99.25", "99.25"), ("[99, 48.5]", "99,48.5"), ("'99,48.5'", "99,48.5")],
)
def test_lengths_of_maps_are_numbers_pairs_or_texts(given, text):
    table = f"[surface.reading]\nside = {given}\n[load]"
    written = SCANS.format(files='"maps"', nodes="9").replace("[load]", table, 1)
    own = Scene.parse(written, "a.toml")
    assert own.surface.reading.given() == {"side": text}
    assert Scene.from_text(own.text()) == own
    assert sides_from(text)[0] in {99.0, 99.25}


def test_keys_that_are_not_given_stay_out_of_the_text():
    surface = json.loads(scene().text())["surface"]
    assert surface == {
        "generator": "scans",
        "files": ["maps"],
        "nodes": [20, 30],
        "preparation": {"level": "plane"},
        "reading": {},
    }


KEYS = (
    *("files", "nodes", "spacing", "reading", "preparation", "found", "against", "generator"),
    *("reading.side", "reading.unit", "reading.channel", "reading.other"),
    *("preparation.crop", "preparation.invert", "preparation.mask", "preparation.despike"),
    *("preparation.level", "preparation.form", "preparation.fill", "preparation.filter"),
    *("preparation.downsample", "found.maps", "found.spacing"),
)
junk = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=2)
    ),
    max_leaves=5,
)


@settings(max_examples=200)
@given(st.sampled_from(KEYS), junk)
def test_any_value_of_any_key_is_taken_or_refused_in_one_line(key, value):
    content = json.loads(with_maps(scene()).text())
    table = content["surface"]
    *above, last = key.split(".")
    for name in above:
        table = table[name]
    table[last] = value
    said = ""
    try:
        taken = Scene.from_text(json.dumps(content), "a.toml")
    except InputError as refusal:
        said = str(refusal)
    else:
        assert Scene.from_text(taken.text()) == taken
    assert said == "" or (said.startswith("a.toml: ") and len(said) < 1000)
    assert len(said.splitlines()) <= 1
