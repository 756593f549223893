"""Hints for keys that are not known, in every table and for every generator."""

import pytest

from gen.runtime.errors import InputError
from gen.scene import Scene

SPECTRAL = "a key of the generator 'spectral', and this scene has 'diamond-square'"
OF_SURFACE = "the keys of [surface] are against, generator, hurst, nodes, side and sigma0"
OF_CONTACT = (
    "the keys of [contact] are boundary, far_field, hardness, hardness_ratio, kernel,"
    " layer, max_iterations, modulus, poisson, rtol and spacing"
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
def test_a_wrong_name_has_the_hint_of_its_table(key):
    with pytest.raises(InputError) as refused:
        Scene.parse(f"samples = 3\n{key} = 0.3", "a.toml")
    hint = {**SLIPS, **FURTHER}[key]
    assert str(refused.value) == f"a.toml: unknown key {key} = 0.3; {hint}"


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("rms", "it is called surface.rms_height here"),
        (
            "sigma0",
            "a key of the generator 'diamond-square', and this scene has 'spectral'",
        ),
    ],
)
def test_keys_and_synonyms_are_those_of_the_generator(key, hint):
    text = "samples = 3\n[surface]\ngenerator = 'spectral'\nroll_off = 90.0\ncut_off = 20.0\n"
    with pytest.raises(InputError, match=hint):
        Scene.parse(f"{text}{key} = 1.0", "a.toml")
