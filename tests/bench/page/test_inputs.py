"""Commands of parts are filled in with what is there."""

from pathlib import Path

from page_parts import inputs, part, written


def test_what_is_not_there_is_left_out_of_a_command(tmp_path: Path) -> None:
    wishing = part("wishing", "-m bench paper [--cost {cost}] [--comparison {comparison}]")
    assert inputs(tmp_path).arguments(wishing) == ["-m", "bench", "paper"]
    written("cost.csv", [["solve"], [1]], tmp_path / "cost")
    assert inputs(tmp_path).arguments(wishing)[3:] == ["--cost", str(tmp_path / "cost")]
