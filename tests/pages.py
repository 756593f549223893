"""The pages that users read, README.md and those of docs/, and what they show."""

import re
import shlex
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PATHS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in PATHS
}
"""The text of each page by its path from the top folder."""

TEXT = "\n".join(PAGES.values())


def codes(language: str, page: str | None = None) -> list[str]:
    """Return the blocks of code in a language, of one page or of all."""
    text = TEXT if page is None else PAGES[page]
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def links(page: str) -> list[str]:
    """Return the targets of a page's links and pictures that lie in this repository."""
    prose = re.sub(r"```.*?```", "", PAGES[page], flags=re.DOTALL)
    found = re.findall(r"\]\(([^)\s]+)\)", prose)
    return [target for target in found if "://" not in target]


def anchors(page: str) -> set[str]:
    """Return the names by which links reach the headings of a page."""
    prose = re.sub(r"```.*?```", "", PAGES[page], flags=re.DOTALL)
    titles = re.findall(r"^#+ (.*)$", prose, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def steps(page: str, section: str = "") -> list[tuple[str, str]]:
    """Return what a page shows to be done, in its order: ("python", code) or ("shell", line).

    Lines of a shell are those that are indented by four, outside of lists, or fenced as `sh`;
    continued lines are joined, and comments are taken off. A section is that below a heading of
    the second level.
    """
    text = PAGES[page]
    if section:
        text = text.partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    found = []
    fenced = r"^```(\w*)[^\n]*\n(.*?)^```$"
    indented = r"(?:(?<=\n\n)|\A)((?: {4}[^\n]*\n)+)"
    for block in re.finditer(
        f"{fenced}|{indented}", text, flags=re.DOTALL | re.MULTILINE
    ):
        language, code, lines = block.groups()
        if language == "python":
            found.append(("python", code))
        elif lines or language == "sh":
            text = (lines or code).replace("\\\n", " ")
            found += [
                ("shell", line.strip()) for line in text.splitlines() if line.strip()
            ]
    return found


def commands(page: str) -> list[list[str]]:
    """Return the words of each command that a page shows, from `gen`, `learn` or `bench` on.

    They stand in blocks of a shell, or in the text between backticks.
    """
    lines = [line for kind, line in steps(page) if kind == "shell"]
    prose = re.sub(r"^```.*?^```$", "", PAGES[page], flags=re.DOTALL | re.MULTILINE)
    lines += [line.replace("\n", " ") for line in re.findall(r"`([^`]+)`", prose)]
    found = []
    for line in lines:
        started = re.search(r"(?:python -m|asperity) (?=(?:gen|learn|bench) )", line)
        if started:
            found.append(shlex.split(line[started.end() :], comments=True))
    return found
