"""Every link of the built pages leads somewhere: a Sphinx extension that needs no network.

Links inside the manual, with the places on a page that they name, and pictures have to be there.
Addresses elsewhere are only listed, in `external-links.txt` beside the pages.
"""

from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urldefrag, urlsplit

from sphinx.application import Sphinx
from sphinx.util import logging

LISTED = "external-links.txt"
logger = logging.getLogger(__name__)


class Page(HTMLParser):
    """The links of a page, and the places on it that links can name."""

    def __init__(self) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.places: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep what a tag links to, and its name."""
        for name, value in attrs:
            if value and name in {"href", "src"} and tag != "base":
                self.links.add(value)
            elif value and name in {"id", "name"}:
                self.places.add(value)


def read_pages(folder: Path) -> dict[Path, Page]:
    """Read all pages in a folder."""
    pages = {}
    for path in sorted(folder.rglob("*.html")):
        if "_static" in path.parts:  # templates of the theme
            continue
        page = pages[path.resolve()] = Page()
        page.feed(path.read_text(encoding="utf-8"))
    return pages


def broken_links(pages: dict[Path, Page]) -> list[tuple[Path, str]]:
    """Return each link that leads nowhere, with the page that it stands on."""
    broken = []
    for path, page in pages.items():
        for link in sorted(page.links):
            if urlsplit(link).scheme or link.startswith("//"):
                continue
            address, place = urldefrag(link)
            target = (
                (path.parent / unquote(urlsplit(address).path)).resolve()
                if address
                else path
            )
            place = unquote(place)
            known = pages[target].places if target in pages else set()
            if not target.exists() or (place and target in pages and place not in known):
                broken.append((path, link))
    return broken


def external_links(pages: dict[Path, Page]) -> list[str]:
    """Return the addresses of other places that the pages name."""
    links = {link for page in pages.values() for link in page.links}
    return sorted(link for link in links if urlsplit(link).scheme in {"http", "https"})


def check(app: Sphinx, exception: Exception | None) -> None:
    """Warn of each link that leads nowhere, and list the addresses of other places."""
    if exception or app.builder.name != "html":
        return
    folder = Path(app.outdir)
    pages = read_pages(folder)
    for path, link in broken_links(pages):
        logger.warning(
            "%s: the link %s leads nowhere", path.relative_to(folder.resolve()), link
        )
    listed = external_links(pages)
    (folder / LISTED).write_text(
        "".join(f"{link}\n" for link in listed), encoding="utf-8"
    )
    logger.info(
        "links: %d pages checked, %d addresses listed in %s",
        len(pages),
        len(listed),
        LISTED,
    )


def setup(app: Sphinx) -> dict[str, Any]:
    """Look at the pages once they are written."""
    app.connect("build-finished", check)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
