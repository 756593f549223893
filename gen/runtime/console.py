"""Consoles for tables and lines of any origin: what a file holds cannot drive the terminal."""

import errno
import os
from collections.abc import Iterator
from typing import Any

from rich.console import Console, ConsoleOptions, ConsoleRenderable, RenderHook
from rich.segment import Segment
from rich.text import Text

from gen.runtime.terminal import printable


class _Harmless:
    """What is to be printed, without control characters of its own.

    Parameters
    ----------
    content : anything that rich can print
    """

    def __init__(self, content: ConsoleRenderable) -> None:
        self._content = content

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Segment]:
        """Pass rich's own control codes and ends of lines on, and the texts once printable."""
        for segment in console.render(self._content, options):
            lines = "\n".join(printable(line) for line in segment.text.split("\n"))
            yield segment if segment.control else Segment(lines, segment.style)


class _Censor(RenderHook):
    """Makes whatever a console prints harmless; a text is a single line."""

    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        """Called by rich before it prints."""
        for each in renderables:
            if isinstance(each, Text):
                each.plain = printable(each.plain)
        return [_Harmless(each) for each in renderables]


class _Console(Console):
    """A console that raises what its stream raises; rich's own would end the process instead."""

    def on_broken_pipe(self) -> None:
        """Called by rich while it handles a BrokenPipeError."""
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))


def console(**settings: Any) -> Console:
    """Make a console whose texts hold no control characters.

    Parameters
    ----------
    settings : what `rich.console.Console` takes
    """
    made = _Console(**settings)
    made.push_render_hook(_Censor())
    return made


def wide_console(width: int) -> Console:
    """Make a console as wide as the terminal, or of a fixed width where there is none."""
    return console(width=None if Console().is_terminal else width)
