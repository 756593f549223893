"""What another folder calls says what it takes, in numpydoc: parameters, results, no others."""

import ast
import functools
import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("bem", "gen", "learn", "bench", "asperity")
HELD = ("bem", "gen", "learn", "bench")
"""Packages that other packages or their own folders import; nothing imports `asperity`."""

COMMANDS = {"commands", "commands.py", "cli.py", "command.py"}
"""Folders and files of commands, whose docstrings are printed as help texts."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Documented:
    """A function or method that another folder calls."""

    place: str  # path and line, for the message
    function: Function
    method: bool

    @property
    def parameters(self) -> list[str]:
        """Names of the signature, as numpydoc writes them, without `self` and `cls`."""
        arguments = self.function.args
        names = [item.arg for item in (*arguments.posonlyargs, *arguments.args)]
        if self.method and not _decorated(self.function, "staticmethod"):
            names = names[1:]
        if arguments.vararg:
            names.append(f"*{arguments.vararg.arg}")
        names += [item.arg for item in arguments.kwonlyargs]
        if arguments.kwarg:
            names.append(f"**{arguments.kwarg.arg}")
        return names

    @property
    def docstring(self) -> str:
        """The docstring without its indentation; empty if the function has none."""
        return inspect.cleandoc(ast.get_docstring(self.function) or "")

    @property
    def returns(self) -> bool:
        """Whether the annotation names a result."""
        annotation = self.function.returns
        return annotation is not None and ast.unparse(annotation) not in {
            "None",
            "NoReturn",
            "Never",
        }


def _decorated(function: Function, name: str) -> bool:
    return any(ast.unparse(item).endswith(name) for item in function.decorator_list)


@functools.cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def files_of(packages: tuple[str, ...]) -> list[Path]:
    return [
        path for package in packages for path in sorted((ROOT / package).rglob("*.py"))
    ]


def is_command(path: Path) -> bool:
    return bool(set(path.relative_to(ROOT).parts) & COMMANDS)


def home_of(module: str) -> Path:
    """The file of a module's dotted name."""
    path = ROOT / module.replace(".", "/")
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@functools.cache
def imported_elsewhere() -> set[tuple[Path, str]]:
    """Home and name of all that a file imports from another folder of the tree."""
    names = set()
    for path in files_of(PACKAGES):
        for node in ast.walk(tree_of(path)):
            if not isinstance(node, ast.ImportFrom) or not node.module:
                continue
            home = home_of(node.module)
            if home.parent != path.parent and home.is_file():
                names |= {(home, alias.name) for alias in node.names}
    return names


@functools.cache
def folders_that_read() -> dict[str, set[Path]]:
    """Folders whose files read an attribute, by its name."""
    folders: dict[str, set[Path]] = {}
    for path in files_of(PACKAGES):
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Attribute):
                folders.setdefault(node.attr, set()).add(path.parent)
    return folders


def read_outside(name: str, folder: Path) -> bool:
    """Whether a file outside of a folder reads an attribute of this name."""
    return bool(folders_that_read().get(name, set()) - {folder})


def overrides(method: Function, owner: ast.ClassDef) -> bool:
    """Whether a method may take its description from a class that its own one extends."""
    return (
        bool(owner.bases)
        and not method.name.startswith("_")
        and not any(
            ast.unparse(base).endswith(("Protocol", "NamedTuple", "Generic", "Enum"))
            for base in owner.bases
        )
    )


def called_elsewhere(packages: tuple[str, ...]) -> Iterator[Documented]:
    """Public functions with arguments that another folder imports, and methods of such classes."""
    imported = imported_elsewhere()
    for path in files_of(packages):
        if is_command(path):
            continue
        for node in tree_of(path).body:
            if (path, getattr(node, "name", "")) not in imported:
                continue
            place = path.relative_to(ROOT).as_posix()
            if isinstance(node, Function):
                yield Documented(f"{place}:{node.lineno} {node.name}", node, method=False)
            if not isinstance(node, ast.ClassDef):
                continue
            for method in node.body:
                if (
                    isinstance(method, Function)
                    and not method.name.startswith("_")
                    and read_outside(method.name, path.parent)
                    and not overrides(method, node)
                    and not _decorated(method, "overload")
                ):
                    name = f"{place}:{method.lineno} {node.name}.{method.name}"
                    yield Documented(name, method, method=True)


def described(docstring: str, section: str) -> list[str] | None:
    """Names that a section of a docstring describes, in order; None without the section."""
    start = re.search(rf"^{section}\n-+\n", docstring, re.MULTILINE)
    if start is None:
        return None
    text = docstring[start.end() :]
    following = re.search(r"^\S[^\n]*\n-{3,}$", text, re.MULTILINE)
    lines = text[: following.start() if following else None].splitlines()
    heads = [line.partition(" : ")[0] for line in lines if line and not line[0].isspace()]
    return [name.strip() for head in heads for name in head.split(",")]


def faults(documented: Documented) -> Iterator[str]:
    """What the docstring of a function lacks."""
    parameters = documented.parameters
    listed = described(documented.docstring, "Parameters")
    if parameters and listed is None:
        yield "has no Parameters"
    elif parameters and sorted(listed or []) != sorted(parameters):
        yield f"describes {listed}, and takes {parameters}"
    sections = ("Returns", "Yields")
    results = [described(documented.docstring, section) for section in sections]
    if parameters and documented.returns and results == [None, None]:
        yield "has neither Returns nor Yields"


@pytest.mark.parametrize("package", HELD)
def test_what_another_folder_calls_says_what_it_takes_and_returns(package):
    functions = list(called_elsewhere((package,)))
    assert len(functions) > 30, "the search for functions is broken"
    wrong = [f"{item.place} {fault}" for item in functions for fault in faults(item)]
    assert not wrong, "\n".join(wrong)


DOCUMENTED = """Add two numbers.

    Parameters
    ----------
    x, y : int
        Numbers.
    *rest : str

    Returns
    -------
    int
"""


def function_with(signature: str, docstring: str) -> Function:
    function = ast.parse(f"def {signature}:\n    {docstring!r}").body[0]
    assert isinstance(function, Function)
    return function


def test_a_docstring_is_read_as_numpydoc():
    text = inspect.cleandoc(DOCUMENTED)
    assert described(text, "Parameters") == ["x", "y", "*rest"]
    assert described(text, "Returns") == ["int"]
    assert described("Do it.", "Parameters") is None


def test_a_parameter_that_is_missing_or_too_many_is_named():
    function = function_with("add(x, z) -> int", DOCUMENTED)
    (fault,) = faults(Documented("add", function, method=False))
    assert fault == "describes ['x', 'y', '*rest'], and takes ['x', 'z']"


def test_a_result_that_is_not_described_is_named():
    text = "Add.\n\n    Parameters\n    ---\n    x : int\n"
    function = function_with("add(x) -> int", text)
    (fault,) = faults(Documented("add", function, method=False))
    assert fault == "has neither Returns nor Yields"
