"""Every level of the shipped factors makes a scene."""

from bench.paper.facts import RANGES
from bench.paper.nearest.baselines import SPLITS
from bench.paper.nearest.candidates import factors, first
from gen.scene.distribution import limits

ALL = factors()


def test_every_level_makes_a_scene_within_the_papers_ranges() -> None:
    start = first(ALL)
    for place in range(len(ALL)):
        for candidate in (start, *start.neighbours(place)):
            scene = candidate.scene(100)
            low, high = RANGES["hurst"]
            assert (
                low <= min(limits(scene.surface.hurst)) <= max(limits(scene.surface.hurst)) <= high
            )
            for piece in scene.pieces:
                assert 5 <= min(limits(piece.range)) <= max(limits(piece.range)) <= 45
            assert candidate.value("split") in SPLITS
            assert scene.samples == 100


def test_neighbours_differ_in_one_factor() -> None:
    start = first(ALL)
    for place, factor in enumerate(ALL):
        others = list(start.neighbours(place))
        assert len(others) == len(factor.levels) - 1
        for other in others:
            changed = {name for name in start.texts() if start.texts()[name] != other.texts()[name]}
            assert changed == {factor.name}


def test_texts_tell_readings_apart() -> None:
    for factor in ALL:
        assert len({str(level) for level in factor.levels}) == len(factor.levels)
