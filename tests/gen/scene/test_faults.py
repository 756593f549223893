"""Messages about scenes: the hint for a key that is not known, in every command that reads it."""

from pathlib import Path

import pytest

from gen import cli
from gen.runtime.errors import InputError
from gen.scene import Scene, differences

SPECTRAL = "a key of the generator 'spectral', and this scene has 'diamond-square'"
OF_SURFACE = "the keys of [surface] are against, generator, hurst, nodes, side and sigma0"
OF_CONTACT = (
    "the keys of [contact] are boundary, far_field, hardness, hardness_ratio, kernel,"
    " max_iterations, modulus, poisson, rtol and spacing"
)
SLIPS = {
    "contact.young": "it is called contact.modulus here",
    "contact.E": "it is called contact.modulus here",
    "contact.nu": "it is called contact.poisson here",
    "contact.e_star": "E* follows from contact.modulus and contact.poisson: modulus /"
    " (1 - poisson^2)",
    "contact.friction": "friction is not modelled: contacts have none",
    "contact.poisson_ratio": "the closest known key is contact.poisson",
    "contact.roughness": OF_CONTACT,
    "surface.hurst_exponent": "the closest known key is surface.hurst",
    "surface.H": "it is called surface.hurst here",
    "surface.sigma": "it is called surface.sigma0 here",
    "surface.rms_height": f"rms_height is {SPECTRAL}",
    "surface.resolution": OF_SURFACE,
    "load.min": "it is called load.range here",
}
"""Plausible wrong names of keys, and the hint for each."""

FURTHER = {
    "sample": "the closest known key is samples",
    "nodes": "it is a key of another table: surface.nodes",
    "surface.rtol": "it is a key of another table: contact.rtol",
    "surface.lambda_s": f"cut_off is {SPECTRAL}",
    "surface.spacing": "spacing is a key of the generator 'scans', and this scene has"
    " 'diamond-square'",
    "surface.heights": OF_SURFACE,
    "contact.pressure": OF_CONTACT,
    "contact.max_iter": "the closest known key is contact.max_iterations",
    "load.pressure": "give quantity = 'pressure' and range = [low, high]",
    "delta.rnge": "the closest known key is delta.range",
}


@pytest.mark.parametrize("key", [*SLIPS, *FURTHER])
def test_a_wrong_name_has_the_hint_of_its_own_table(key):
    with pytest.raises(InputError) as refused:
        Scene.parse(f"samples = 3\n{key} = 0.3", "a.toml")
    hint = {**SLIPS, **FURTHER}[key]
    assert str(refused.value) == f"a.toml: unknown key {key} = 0.3; {hint}"


def test_another_generator_has_its_own_keys_and_synonyms():
    text = "samples = 3\n[surface]\ngenerator = 'spectral'\nroll_off = 90.0\ncut_off = 20.0\n"
    for key, hint in (
        ("rms", "it is called surface.rms_height here"),
        (
            "sigma0",
            "a key of the generator 'diamond-square', and this scene has 'spectral'",
        ),
    ):
        with pytest.raises(InputError, match=hint):
            Scene.parse(f"{text}{key} = 1.0", "a.toml")


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("key", ["contact.young", "sample", "load.min"])
def test_run_and_dry_run_say_the_same_line(key, refused):
    """Without the keys that are missing because another one is misspelt."""
    start = "" if key == "sample" else "samples = 3\n"
    Path("slip.toml").write_text(f"{start}{key} = 5\n")
    run = refused(cli, "run", "slip.toml", "-o", "a.h5")
    assert run == refused(cli, "run", "slip.toml", "-o", "a.h5", "--dry-run")
    assert "more)" not in run


def test_a_range_of_delta_is_one_piece():
    texts = (
        "delta.range = [1.0, 4.0]",
        "delta.pieces = [{ share = 1.0, range = [1.0, 4.0] }]",
    )
    ranged, pieces = (Scene.parse(f"samples = 3\n{text}", "a.toml") for text in texts)
    assert ranged == pieces
    assert ranged.fingerprint() == pieces.fingerprint()
    assert differences(ranged, pieces) == []
    with pytest.raises(
        InputError, match="delta: range and pieces are both given: give one"
    ):
        Scene.parse(f"samples = 3\n{texts[1]}\n{texts[0]}", "a.toml")


@pytest.mark.usefixtures("here")
def test_another_scene_of_a_database_is_a_list_with_a_key_a_line(capsys):
    for name, seed in (("one", 1), ("other", 2)):
        Path(f"{name}.toml").write_text(
            f"samples = 2\nseed = {seed}\n[surface]\nnodes = 9\nside = {seed}00.0\n"
        )
        assert cli.main(["run", f"{name}.toml", "-o", f"{name}.h5"]) == 0
    capsys.readouterr()
    assert cli.main(["run", "other.toml", "-o", "one.h5"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "gen: one.h5 holds another scene; give another name, or the file's own scene:",
        "  seed: 1 in the file, 2 asked for",
        "  surface.side: 100.0 in the file, 200.0 asked for",
    ]
    assert cli.main(["merge", "one.h5", "other.h5", "-o", "both.h5"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "gen: one.h5 and other.h5 hold different scenes, and are not merged:",
        "  seed: 1 in one.h5, 2 in other.h5",
        "  surface.side: 100.0 in one.h5, 200.0 in other.h5",
    ]
