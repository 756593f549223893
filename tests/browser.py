"""A real browser without a window, where one is installed."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")


@dataclass(frozen=True)
class Seen:
    """What a browser says about a page.

    Attributes
    ----------
    complaints : errors, warnings and requests that failed
    content_width : of the whole page [pixels]
    shown_pictures, broken_pictures : how many pictures were and were not drawn
    smallest_scale : least width on the page over the width of the file, of all pictures
    clipped_code : how many blocks of code are wider than what is seen of them
    """

    complaints: list[str]
    content_width: int
    shown_pictures: int
    broken_pictures: int
    smallest_scale: float
    clipped_code: int


def look(
    page: Path, width: int, picture: Path | None = None, *, printed: bool = False
) -> Seen:
    """Open a file in a window of some width [pixels], or as it is printed on paper of that width.

    A picture of it goes where one is asked for.

    Skips the test where no browser, or nothing to drive it, is installed.
    """
    driver = pytest.importorskip("playwright.sync_api")
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip("no browser: install the package chromium")
    complaints: list[str] = []
    with driver.sync_playwright() as playwright:
        # Browsers refuse to run as root inside a sandbox of their own.
        browser = playwright.chromium.launch(
            executable_path=program, args=["--no-sandbox"]
        )
        opened = browser.new_page(viewport={"width": width, "height": 900}, offline=True)
        opened.on("console", lambda message: complaints.append(message.text))
        opened.on("pageerror", lambda error: complaints.append(str(error)))
        opened.on("requestfailed", lambda request: complaints.append(request.url[:100]))
        if printed:
            opened.emulate_media(media="print")
        opened.goto(page.resolve().as_uri())
        broken = "[...document.images].filter(i => !i.complete || !i.naturalWidth).length"
        scales = "[1, ...[...document.images].map(i => i.clientWidth / i.naturalWidth)]"
        wider = "e => e.clientWidth && e.scrollWidth > e.clientWidth + 1"
        seen = Seen(
            complaints=complaints,
            content_width=opened.evaluate("document.documentElement.scrollWidth"),
            shown_pictures=opened.evaluate(f"document.images.length - {broken}"),
            broken_pictures=opened.evaluate(broken),
            smallest_scale=opened.evaluate(f"Math.min(...{scales})"),
            clipped_code=opened.evaluate(
                f"[...document.querySelectorAll('code, pre')].filter({wider}).length"
            ),
        )
        if picture is not None:
            opened.screenshot(path=picture, full_page=True)
        browser.close()
    return seen
