"""Every command on three ranks with bad input of every kind: one line, code 2, and never a hang."""

import re
from importlib.util import find_spec

import command_lines
import pytest
from launch import walk

pytestmark = pytest.mark.mpi

GOOD = [
    ["gen", "run", "good.toml", "-o", "good.h5"],
    ["learn", "fit", "good.h5", "-o", "good.s", "--model", "decision-tree"],
    ["learn", "compare", "good.h5", "-o", "comparison", "--model", "decision-tree"],
]
"""What succeeds on three ranks, and makes the files that the other command lines name."""

REPEATED = re.compile(r"warning: \S+ was given \d+ times: the last one counts\n")
"""The warning of an option with one value that is given again."""

LEARNING = find_spec("sklearn") is not None
"""Whether the extra 'learn' is there; where h5py has MPI it need not be."""


def test_every_command_has_bad_command_lines():
    """A new command needs an entry in tests/command_lines.py."""
    for program, known in command_lines.COMMANDS.items():
        assert set(command_lines.commands(program)) == set(known)


@pytest.mark.long
def test_every_command_refuses_bad_input_on_all_ranks_in_one_line(tmp_path):
    command_lines.prepare(tmp_path)
    walked = command_lines.COMMANDS if LEARNING else ["gen"]
    cases = [
        (program, *case) for program in walked for case in command_lines.cases(program)
    ]
    benches = [["bench", name, "--nonsense"] for name in command_lines.commands("bench")]
    lines = [[program, *arguments] for program, arguments, _ in cases]
    good = GOOD if LEARNING else GOOD[:1]
    ended = iter(walk(3, [*good, *benches, *lines], tmp_path))
    for _, ends in zip(good, ended, strict=False):
        assert [end.code for end in ends] == [0, 0, 0], ends
    for _, ends in zip(benches, ended, strict=False):
        assert [end.code for end in ends] == [2, 2, 2]
        refusal = "bench: started as 3 processes; start it as one\n"
        assert [end.errors for end in ends] == [refusal, "", ""]
    wrong = []
    for (program, arguments, word), ends in zip(cases, ended, strict=True):
        (code, errors), *others = [(end.code, end.errors) for end in ends]
        # A bad value follows a good one of the same option, which is warned of.
        refusal = REPEATED.sub("", errors)
        is_right = word in refusal or (not LEARNING and " needs " in refusal)
        is_line = refusal.startswith(f"{program}: ") and refusal.count("\n") == 1
        if code != 2 or others != [(2, ""), (2, "")] or not (is_line and is_right):
            wrong.append(f"{program} {' '.join(arguments)[:150]}: {ends}")
    assert not wrong, "\n".join([f"{len(wrong)} of {len(cases)}", *wrong])
    left = {path.name for path in tmp_path.iterdir()}
    assert not left & {"new", "new.h5", "new.png", "new.h", "new-folder"}
    assert (tmp_path / "text").read_text() == command_lines.TEXT
    assert not list((tmp_path / "folder").iterdir())
