"""The extensions that build the manual find broken links, and blocks that name nothing."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

EXTENSIONS = Path(__file__).resolve().parents[1] / "docs" / "extensions"


@pytest.fixture
def extension(monkeypatch):
    """Import an extension as Sphinx does, where Sphinx is installed."""
    pytest.importorskip("sphinx")
    monkeypatch.syspath_prepend(str(EXTENSIONS))
    yield __import__
    for name in ("link_check", "results", "tables"):
        sys.modules.pop(name, None)


def test_links_that_lead_nowhere_are_found(extension, tmp_path):
    check = extension("link_check")
    (tmp_path / "sub").mkdir()
    (tmp_path / "index.html").write_text(
        '<h1 id="top">A</h1><a href="sub/other.html#place">good</a><a href="#top">good</a>'
        '<a href="sub/other.html#gone">bad</a><a href="none.html">bad</a><img src="none.png">'
        '<a href="https://example.org/a?b#c">elsewhere</a>'
    )
    (tmp_path / "sub" / "other.html").write_text('<p id="place"><a href="../index.html">good</a>')
    pages = check.read_pages(tmp_path)
    broken = [(path.name, link) for path, link in check.broken_links(pages)]
    assert broken == [
        ("index.html", "none.html"),
        ("index.html", "none.png"),
        ("index.html", "sub/other.html#gone"),
    ]
    assert check.external_links(pages) == ["https://example.org/a?b#c"]


@pytest.mark.parametrize(
    ("block", "fault"),
    [
        ("```{report} none\n```", KeyError),
        ("```{result} cost\nbench/results/peers/peers.csv\n```", ValueError),
    ],
)
def test_a_block_that_names_what_is_not_there_stops_the_build(extension, tmp_path, block, fault):
    results = extension("results")
    environment = SimpleNamespace(
        doc2path=lambda _: str(tmp_path / "page.md"), note_dependency=lambda *_, **__: None
    )
    with pytest.raises(fault):
        results.fill(SimpleNamespace(env=environment), "page", [f"{block}\n"])
