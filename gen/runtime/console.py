"""Consoles that replace control characters, so that texts of files cannot drive the terminal."""

import errno
import os
import sys
from collections.abc import Iterator
from typing import Any

from rich.console import Console, ConsoleOptions, ConsoleRenderable, RenderHook
from rich.segment import Segment
from rich.text import Text

from gen.runtime.terminal import printable


class _Harmless:
    """Content to print with its control characters replaced.

    Parameters
    ----------
    content : rich.console.ConsoleRenderable
        Anything that rich can print.
    """

    def __init__(self, content: ConsoleRenderable) -> None:
        self._content = content

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Segment]:
        """Yield rich's own control codes and ends of lines unchanged, and texts made printable."""
        for segment in console.render(self._content, options):
            lines = "\n".join(printable(line) for line in segment.text.split("\n"))
            yield segment if segment.control else Segment(lines, segment.style)


class _Censor(RenderHook):
    """A hook that makes everything printable; a text is a single line."""

    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        """Make content printable; rich calls this before it prints."""
        for content in renderables:
            if isinstance(content, Text):
                content.plain = printable(content.plain)
        return [_Harmless(content) for content in renderables]


class _Console(Console):
    """A console that raises BrokenPipeError; rich's own would end the process instead."""

    def on_broken_pipe(self) -> None:
        """Raise the error again; rich calls this while it handles it."""
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))


def console(**settings: Any) -> Console:
    """Make a console that prints no control characters of its content.

    Parameters
    ----------
    **settings
        Arguments of `rich.console.Console`.
    """
    made = _Console(**settings)
    made.push_render_hook(_Censor())
    return made


def plain_console() -> Console:
    """Make a console for plain text; lines that go to a file or a pipe are not broken."""
    width = None if sys.stdout.isatty() else 1000
    return console(markup=False, highlight=False, width=width)


def wide_console(width: int) -> Console:
    """Make a console as wide as the terminal, or of a fixed width without one.

    Parameters
    ----------
    width : int
        Width without a terminal [characters].
    """
    return console(width=None if Console().is_terminal else width)
