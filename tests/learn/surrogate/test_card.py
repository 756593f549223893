"""The model card."""

from learn import cli


def run(*arguments):
    return cli.main([str(argument) for argument in arguments])


def test_a_card_says_what_it_was_made_of(work, capsys):
    assert run("card", "hybrid.surrogate") == 0
    said = capsys.readouterr().out
    for text in (
        "Kernel Ridge for area, force, hybrid features",
        "58 trained, 14 calibrated, 18 tested",
        "33 x 33 nodes, side 1000 um",
        "scikit-learn",
        "BSD-3-Clause",
        "refined_share",
        "95 %",
    ):
        assert text in said, text
