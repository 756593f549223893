"""Commands in messages, as the user types them."""

import pytest

from gen.runtime.invocation import started_as, to_type


@pytest.mark.parametrize(
    ("name", "typed"),
    [("asperity gen", "asperity learn card x"), ("gen", "python -m learn card x")],
)
def test_messages_name_commands_as_they_are_typed(name, typed):
    with started_as(name):
        assert to_type("learn card x") == typed
    assert to_type("learn card x") == "python -m learn card x"


def test_the_path_of_a_command_that_was_typed_stays():
    assert to_type("asperity gen run") == "asperity gen run"
    assert to_type("gen run") == "python -m gen run"
