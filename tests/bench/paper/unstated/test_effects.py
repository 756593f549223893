"""Choices that the paper leaves open differ from the preset one at a time."""

from bench.paper.unstated.effects import OURS, VARIANTS
from gen.scene import Scene, load

PAPER = load("paper")


def test_choices_differ_from_the_preset_one_at_a_time() -> None:
    preset = PAPER.model_dump(exclude={"title", "samples"})
    assert VARIANTS[0].name == OURS
    for variant in VARIANTS:
        scene = Scene.parse("samples = 9\n" + variant.scene, variant.name).model_dump(
            exclude={"title", "samples"}
        )
        different = [
            (key, name)
            for key in scene
            for name in (scene[key] if isinstance(scene[key], dict) else [""])
            if (scene[key][name] if name else scene[key])
            != (preset[key][name] if name else preset[key])
        ]
        expected = {OURS: 0, "mirco": 3}.get(variant.name, 1)
        assert len(different) == expected, variant
