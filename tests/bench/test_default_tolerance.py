"""The default tolerance: how often each tolerance finds the right number of contact nodes."""

from pathlib import Path

import pytest
from launch import launch

from bench import default_tolerance
from bench.default_tolerance import Row, cheapest_right, markdown_table, right_counts
from gen.runtime.errors import InputError


def test_tighter_tolerances_count_better(tmp_path: Path) -> None:
    scene = tmp_path / "small.toml"
    scene.write_text("samples = 12\n[surface]\nnodes = 33\n")
    loose, middle, tight = right_counts(str(scene), 12, (1e-1, 1e-4, 1e-10))
    assert loose["wrong"] > middle["wrong"] >= tight["wrong"] == 0
    assert loose["force_error"] > middle["force_error"] > tight["force_error"]
    assert loose["convolutions"] < middle["convolutions"] < tight["convolutions"]
    assert loose["largest_miss"] > tight["largest_miss"] == 0
    assert {row["samples"] for row in (loose, middle, tight)} == {12}


def test_samples_without_a_solution_are_left_out(tmp_path: Path) -> None:
    """On a compliant far field, at a Delta that most surfaces cannot bear."""
    scene = tmp_path / "deep.toml"
    scene.write_text(
        "samples = 12\n[surface]\nnodes = 17\n[contact]\nfar_field = 'compliant'\n"
        "[delta]\npieces = [{ share = 1.0, range = [5.0, 60.0] }]\n"
    )
    (count,) = right_counts(str(scene), 12, (1e-8,))
    assert 0 < count["samples"] < 12
    scene.write_text(scene.read_text().replace("[5.0, 60.0]", "[500.0, 600.0]"))
    with pytest.raises(InputError, match="none of the first 12 samples"):
        right_counts(str(scene), 12, (1e-8,))


def counted(rtol: str, right: int) -> Row:
    shares = {"right_percent": right / 10, "wrong": 1000 - right, "samples": 1000}
    costs = {"largest_miss": 1, "force_error": 1e-6, "convolutions": 20.0, "relative_time": 0.5}
    return {"rtol": rtol, **shares, **costs}


@pytest.mark.parametrize(
    ("rights", "cheapest"),
    [
        ((400, 999, 1000), "1e-4"),
        ((400, 998, 999), "1e-6"),
        ((999, 998, 999), "1e-6"),  # luck at a loose tolerance does not count
        ((999, 999, 998), "none of these"),
    ],
)
def test_the_cheapest_tolerance_that_is_right(rights: tuple[int, ...], cheapest: str) -> None:
    rows = [
        counted(rtol, right) for rtol, right in zip(("1e-2", "1e-4", "1e-6"), rights, strict=True)
    ]
    assert cheapest_right(rows) == cheapest
    table = markdown_table(rows)
    assert f"| 1e-4 | {rights[1] / 10:.2f} % | {1000 - rights[1]} of 1000 |" in table
    assert table.endswith(f"Cheapest with 99.9 % right: {cheapest}.")


def test_command_prints_the_default_tolerance(tmp_path: Path) -> None:
    done = launch(
        0, "solver", "--default-tolerance", "--samples", "2", folder=tmp_path, module="bench"
    )
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert len([line for line in lines if line.startswith("| ")]) == 1 + len(
        default_tolerance.RTOLS
    )
