"""Functions of the user's: the source that is hashed runs, and every fault is one line."""

import hashlib
import sys

import numpy as np
import pytest

from gen.runtime.errors import SourceError
from gen.runtime.farm import Overtime, time_limit
from gen.runtime.user_code import (
    TRUSTED,
    load_function,
    source_errors,
    source_hash,
    source_of,
)


@pytest.fixture
def here(here, monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    token = TRUSTED.set(True)
    yield here
    TRUSTED.reset(token)
    sys.modules.pop("of_the_user", None)


def write(folder, text):
    (folder / "of_the_user.py").write_text(text)
    return hashlib.sha256(text.encode()).hexdigest()


def test_a_function_is_that_of_the_source(here):
    """Also where Python would take the compiled file of a source as long and as old."""
    for answer in (1, 2, 3):
        source = write(here, f"def f():\n    return {answer}\n")
        assert source_hash("of_the_user:f") == source
        assert load_function("of_the_user:f", source)() == answer


def test_the_hash_runs_no_code(here):
    write(here, "raise SystemExit\n")
    source_hash("of_the_user:f")
    assert "of_the_user" not in sys.modules


def test_a_module_of_the_current_folder_comes_first(here, tmp_path_factory, monkeypatch):
    write(here, "def f():\n    return 'installed'\n")
    sys.path.insert(0, str(here))
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    monkeypatch.chdir(elsewhere)
    assert source_of("of_the_user:f") == here / "of_the_user.py"
    write(elsewhere, "def f():\n    return 'current'\n")
    assert source_of("of_the_user:f") == elsewhere / "of_the_user.py"


def test_a_module_that_others_have_imported_is_not_run_again(here):
    source = source_hash("gen.surface:generate")
    from gen.surface import generate

    assert load_function("gen.surface:generate", source) is generate


def test_modules_may_define_dataclasses_and_import_their_neighbours(here):
    (here / "neighbour_of_it.py").write_text("number = 5\n")
    source = write(
        here,
        "from __future__ import annotations\nfrom dataclasses import dataclass\n"
        "from neighbour_of_it import number\n@dataclass\nclass A:\n    b: int\n"
        "def f():\n    return A(number).b\n",
    )
    assert load_function("of_the_user:f", source)() == 5


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("def g():\n    pass\n", "of_the_user.py has no function f"),
        (
            "raise ValueError('two\\nlines')\n",
            "of_the_user failed: ValueError: two lines",
        ),
        ("import sys\nsys.exit(3)\n", "importing of_the_user failed: SystemExit: 3"),
    ],
)
def test_a_function_that_cannot_be_loaded_is_one_line(here, text, fault):
    source = write(here, text)
    with pytest.raises(SourceError) as refused:
        load_function("of_the_user:f", source)
    assert fault in str(refused.value)
    assert "\n" not in str(refused.value)
    assert "of_the_user" not in sys.modules or "failed" not in fault


@pytest.mark.parametrize(
    "name", ["no_such_module_here:f", "sys:exit", "gen.no_such_module:f"]
)
def test_a_module_without_a_source_is_refused(here, name):
    with pytest.raises(SourceError, match="no module"):
        source_hash(name)


def test_a_bound_on_the_time_is_no_fault_of_the_function():
    def endless():
        while True:
            pass

    with pytest.raises(Overtime), time_limit(0.05), source_errors("f"):
        endless()


def test_arithmetic_is_handled_elsewhere():
    with pytest.raises(ZeroDivisionError), source_errors("f"):
        raise ZeroDivisionError


def test_memory_that_runs_out_in_a_function_is_the_functions(here):
    fault = "f, row 3: this code of your own has run out of memory: Unable to allocate"
    with pytest.raises(SourceError, match=fault), source_errors("f, row 3"):
        np.empty(2**58)
    source = write(here, "raise MemoryError\n")
    with pytest.raises(
        SourceError, match="importing of_the_user failed: this code of your own"
    ):
        load_function("of_the_user:f", source)
