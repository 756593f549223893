"""Commands of parts are filled in with what is there."""

from pathlib import Path

from page_parts import inputs, part, written


def test_what_is_not_there_is_left_out_of_a_command(tmp_path: Path) -> None:
    wishing = part("wishing", "-m bench paper [--cost {cost}] [--comparison {comparison}]")
    assert inputs(tmp_path).arguments(wishing) == ["-m", "bench", "paper"]
    written("cost.csv", [["solve"], [1]], tmp_path / "cost")
    assert inputs(tmp_path).arguments(wishing)[3:] == ["--cost", str(tmp_path / "cost")]


def test_a_command_that_was_run_elsewhere_names_no_folder_of_that_machine(tmp_path: Path) -> None:
    one = part("one", "-m bench one -o {folder}")
    here = inputs(tmp_path)
    there = "python -m bench one --database '/a b/all/databases/paper.h5' -o '/a b/all/one'"
    assert here.command(one, there) == (
        "python -m bench one --database report/databases/paper.h5 -o report/one"
    )
    own = f"python -m bench one -o {tmp_path / 'one'}"
    assert here.command(one, own) == own
    assert here.command(one, "python -m bench other /data/one.csv") == (
        "python -m bench other /data/one.csv"
    )
    assert here.command(one, "") == ""
