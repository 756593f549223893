"""The rules that keep the house easy to live in: who imports what, and when."""

import ast
import functools
import graphlib
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from launch import python

from gen.database import create
from gen.runtime.installation import command_for
from gen.scene import load

ROOT = Path(__file__).resolve().parents[1]
MAY_IMPORT = {
    "bem": {"bem"},
    "gen": {"gen", "bem"},
    "learn": {"learn", "gen", "bem"},
    "bench": {"bench", "learn", "gen", "bem"},
    "asperity": {"asperity", "bench", "learn", "gen", "bem"},
}
ONE_HOME = {
    "mpi4py": {"gen/runtime/farm.py"},
    "h5py": {"gen/database"},
    "pyfftw": {"bem/operators/filters.py"},
    "threadpoolctl": {"bem/threads.py"},
    "tomllib": {"gen/scene/scene.py", "bench/files.py"},
    "SurfaceTopography": {"gen/maps/instruments.py", "bench/made_maps.py"},
    "matplotlib": {"gen/runtime/figure.py", "bench"},
    "sklearn": {"learn", "bench"},
    "xgboost": {"learn/models.py"},
    "skops": {"learn/surrogate/learnt.py"},
    "joblib": {"learn/executor.py"},
}

TESTED_TOGETHER = {
    "tests/asperity/test_children.py": "processes that commands start, in every command that does",
    "tests/asperity/test_earlier_files.py": "files of version 1.0.0, in every command",
    "tests/asperity/test_strangers_files.py": "code that files name, in every command",
    "tests/bem/test_edgeless.py": "a property of all solves: patches without edges",
    "tests/bem/test_indenters.py": "a property of all solves: pressed indenters",
    "tests/bem/test_properties.py": "a property of all solves: monotony, symmetry, scaling ...",
    "tests/bem/test_yielding.py": "a property of all solves: bodies that yield",
    "tests/gen/generation/test_functions.py": "a user's function, in every command that runs it",
    "tests/gen/test_parts.py": "parts of databases, in every command that reads or writes them",
    "tests/learn/test_arrays.py": "arrays of callers, in every public function",
    "tests/learn/test_crafted_databases.py": "crafted files, for every command that reads them",
}
"""Tests that are named after a property of many modules, and the property."""

BEM_NEEDS = {"numpy", "scipy", "pyfftw", "threadpoolctl"}
NUMERICS = {
    "numpy",
    "scipy",
    "pyfftw",
    "h5py",
    "mpi4py",
    "matplotlib",
    "sklearn",
    "pandas",
}


def is_for_types(node: ast.stmt) -> bool:
    """Whether a statement is `if TYPE_CHECKING`."""
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)


@functools.cache
def imported_modules(path: Path, for_types: bool = True) -> tuple[str, ...]:
    """Names of all modules that a file imports, also inside its functions, or for types alone."""
    return tuple(_imported_modules(path, for_types))


def _imported_modules(path: Path, for_types: bool) -> Iterator[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    if not for_types:
        tree.body = [node for node in tree.body if not is_for_types(node)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            home = ROOT / str(node.module).replace(".", "/")
            for name in node.names:
                inside = (home / name.name).is_dir() or (
                    home / f"{name.name}.py"
                ).is_file()
                yield f"{node.module}.{name.name}" if inside else str(node.module)


def imports(path: Path) -> Iterator[str]:
    """Top-level names of all that a file imports, also inside its functions."""
    return (name.partition(".")[0] for name in imported_modules(path))


def sources(package: str) -> list[Path]:
    found = sorted((ROOT / package).rglob("*.py"))
    assert found
    return found


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_packages_import_one_way(package):
    for path in sources(package):
        wrong = set(imports(path)) & MAY_IMPORT.keys()
        assert wrong <= MAY_IMPORT[package], (
            f"{path} imports {wrong - MAY_IMPORT[package]}"
        )


def room_of(module: str) -> str:
    """The package of a module; of a package that holds further ones, the module itself."""
    path = ROOT / module.replace(".", "/")
    if path.is_dir():
        return module
    if list(path.parent.glob("*/__init__.py")):
        return module
    return module.rpartition(".")[0]


@functools.cache
def arrows(package: str) -> dict[str, set[str]]:
    """The other rooms of a package that each of its rooms imports."""
    found: dict[str, set[str]] = {}
    for path in sources(package):
        module = path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
        here = room_of(module.removesuffix(".__init__"))
        found.setdefault(here, set())
        for other in imported_modules(path, for_types=False):
            if other.partition(".")[0] == package and room_of(other) != here:
                found[here].add(room_of(other))
    return found


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_no_rooms_import_each_other(package):
    graphlib.TopologicalSorter(arrows(package)).prepare()  # CycleError names the circle


CIRCLES = {
    frozenset(
        {"bem.contact", "bem.derived.grid_error"}
    ): "the type of a contact's grid error",
}
"""Files that import each other, at least for types or inside of functions, and what for."""


def files_in_circles(package: str) -> set[frozenset[str]]:
    """Groups of modules of a package each of which leads to each other one of its group."""
    leads: dict[str, set[str]] = {}
    for path in sources(package):
        module = path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
        leads[module.removesuffix(".__init__")] = set(imported_modules(path))
    for middle, beyond in leads.items():  # Warshall's closure
        for targets in leads.values():
            if middle in targets:
                targets.update(beyond)
    inside = {module for module in leads if module in leads[module]}
    return {
        frozenset(
            other for other in inside if other in leads[module] and module in leads[other]
        )
        for module in inside
    }


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_no_files_import_each_other(package):
    """Also not inside of functions or for types: a reader would need both to read one."""
    allowed = {names for names in CIRCLES if min(names).startswith(f"{package}.")}
    assert files_in_circles(package) == allowed


def is_named_after_a_module(test: Path) -> bool:
    """Whether tests/PACKAGE/ROOM/test_NAME.py has a module, or a room, PACKAGE/ROOM/NAME."""
    home = ROOT / test.relative_to("tests").parent / test.stem.removeprefix("test_")
    return home.with_suffix(".py").is_file() or (home / "__init__.py").is_file()


def test_tests_are_named_after_the_modules_that_they_test():
    tests = [
        path.relative_to(ROOT)
        for package in MAY_IMPORT
        for path in sorted((ROOT / "tests" / package).rglob("test_*.py"))
    ]
    other = {path.as_posix() for path in tests if not is_named_after_a_module(path)}
    assert other == TESTED_TOGETHER.keys()


@pytest.mark.parametrize("library", ONE_HOME)
def test_heavy_libraries_have_one_home(library):
    users = {
        path.relative_to(ROOT).as_posix()
        for package in MAY_IMPORT
        for path in sources(package)
        if library in set(imports(path))
    }
    homes = ONE_HOME[library]
    assert users, f"nothing imports {library}: drop the rule"
    strangers = [
        user for user in users if not any(user.startswith(home) for home in homes)
    ]
    assert not strangers


def test_bem_needs_three_libraries():
    for path in sources("bem"):
        foreign = set(imports(path)) - set(sys.stdlib_module_names) - {"bem"}
        assert foreign <= BEM_NEEDS, f"{path} imports {foreign - BEM_NEEDS}"


def test_bem_neither_prints_nor_opens_files():
    for path in sources("bem"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            called = isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
            assert not (called and node.func.id in {"print", "open", "input"}), path


@pytest.mark.parametrize("package", ["gen", "learn", "asperity"])
def test_one_place_prints(package):
    """Where texts of strangers' files lose what would drive a terminal."""
    for path in sources(package):
        text = path.read_text(encoding="utf-8")
        if path.name != "terminal.py":
            assert not re.search(r"\bConsole\(|typer\.s?echo|\bprint\(", text), path


@pytest.mark.few(2)
@pytest.mark.parametrize("line", ["learn fit none.h5 -o a", "bench cost -o c"])
def test_a_missing_extra_is_one_line(line, tmp_path):
    """As after `make quickstart`, which installs what databases need and no more."""
    package, *arguments = line.split()
    home = {"learn": "learn.cli", "bench": "bench.commands"}[package]
    code = "import sys; sys.modules['sklearn'] = sys.modules['sklearn.metrics'] = None\n"
    code += f"from {home} import main; sys.exit(main({arguments!r}))"
    done = python("-c", code, folder=tmp_path)
    assert done.returncode == 2
    (said,) = done.stderr.splitlines()
    assert said.endswith(f"which is not installed: {command_for('learn')}")


QUICK = NUMERICS | {"bem", "bench", "importlib.metadata", "rich", "pydantic"}
LEAVES_OUT = {
    "import bem": NUMERICS - BEM_NEEDS | {"gen", "pydantic", "typer", "rich"},
    "import asperity": {"asperity.functions", "bem"},
    "import gen.generation.sample, gen.generation.run": {
        *("scipy.optimize", "h5py", "rich", "typer", "mpi4py")
    },
    "--version": QUICK | {"learn"},
    "learn --help": QUICK,
    "learn predict --help": NUMERICS,
    "gen --version": QUICK | {"learn"},
    "bench hertz --help": NUMERICS,
    "gen run --help": NUMERICS,
    "gen describe surface.npy --side 100": NUMERICS - {"numpy"},
    "gen contact surface.npy --side 9 --delta 1": NUMERICS - BEM_NEEDS
    | {"bem.derived.flow"},
    "gen run small.toml -o small.h5": NUMERICS - BEM_NEEDS - {"h5py"}
    | {"bem.derived.flow"},
    "gen info made.h5": {"mpi4py", "pyfftw", "matplotlib", "sklearn"},
}
"""What a statement, or a command line of `asperity`, must not import."""


@pytest.mark.few(8)
@pytest.mark.parametrize("line", LEAVES_OUT)
def test_what_is_not_needed_is_not_imported(line, tmp_path):
    np.save(tmp_path / "surface.npy", np.random.default_rng(1).normal(size=(9, 9)))
    (tmp_path / "small.toml").write_text("samples = 3\n[surface]\nnodes = 9\n")
    if "made.h5" in line:
        create(tmp_path / "made.h5", load(str(tmp_path / "small.toml")))
    start = (
        f"import sys; sys.argv[1:] = {line.split()!r}\nfrom asperity.command import main"
    )
    code = line if line.startswith("import ") else f"{start}; assert main() == 0"
    done = python(
        "-c", f"{code}\nimport sys; print(sorted(sys.modules))", folder=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert not set(ast.literal_eval(done.stdout.splitlines()[-1])) & LEAVES_OUT[line]


def test_no_data_lie_in_the_top_folder():
    """Files that somebody tries the commands with there are easily committed with the rest."""
    listed = subprocess.run(
        ["git", "ls-files", "--", ":(glob)*"],
        cwd=ROOT,
        check=False,
        capture_output=True,
        text=True,
    )
    if listed.returncode:
        pytest.skip("not a checkout, or not ours to list")
    kinds = {".cff", ".md", ".py", ".toml", ".yaml", ""}
    assert not [
        name for name in listed.stdout.splitlines() if Path(name).suffix not in kinds
    ]
