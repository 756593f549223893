"""What is installed, and what is said of a version: citation, changelog, extras, compatibility."""

import pkgutil
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest
from test_house import imports

from gen import schema
from gen.runtime import VERSION, command_line, installation
from learn.surrogate.learnt import FORMAT, WITHOUT_POWERS

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PACKAGES = ("asperity", "bem", "gen", "learn", "bench")
COMMIT = "0123456789abcdef0123456789abcdef01234567"
NOT_INSTALLED = "bench/suites/"
"""Where Python files lie that only a clone has."""

EXTRAS = PROJECT["optional-dependencies"]


def copied(folder: Path) -> Path:
    """What a package is built from, outside of the clone."""
    pytest.importorskip("setuptools", minversion="77")
    unwanted = shutil.ignore_patterns("__pycache__", "results")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=unwanted)
    for name in ("LICENSE", "README.md", "pyproject.toml", "setup.py"):
        shutil.copy(ROOT / name, folder)
    return folder


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> zipfile.ZipFile:
    """The wheel of this clone's files, built without a network."""
    folder = copied(tmp_path_factory.mktemp("wheel"))
    build = (
        "pip wheel --quiet --no-build-isolation --no-deps --no-index --wheel-dir made ."
    )
    subprocess.run(
        [sys.executable, "-m", *build.split()], cwd=folder, check=True, timeout=600
    )
    (made,) = (folder / "made").iterdir()
    assert made.name == f"asperity-{VERSION}-py3-none-any.whl"
    return zipfile.ZipFile(made)


def test_a_package_built_from_a_checkout_knows_its_commit(tmp_path):
    """As `pip install` of a clone builds it."""
    copied(tmp_path)
    (tmp_path / ".git").mkdir()
    (tmp_path / ".git" / "HEAD").write_text(f"{COMMIT}\n")
    build = [sys.executable, "setup.py", "-q", "build", "--build-lib", "made"]
    subprocess.run(build, cwd=tmp_path, check=True, timeout=600, capture_output=True)
    asked = "from gen.runtime.installation import git_commit as it; print(it())"
    done = subprocess.check_output(
        [sys.executable, "-c", asked], cwd=tmp_path / "made", text=True
    )
    assert done.strip() == COMMIT


def test_a_package_built_without_a_checkout_has_no_commit(wheel):
    assert "gen/runtime/commit.txt" not in wheel.namelist()


DATA = {
    "asperity/py.typed",
    *("bem/py.typed", "gen/py.typed", "learn/py.typed"),
    *("gen/law/law.h.in", "gen/law/law_4c.py.in"),
    *(
        f"gen/draft/{name}.toml.in"
        for name in ("windows", "like", "population", "load", "contact")
    ),
    *("bench/page.html", "bench/two-blocks.inp"),
}
"""Files of the wheel that are neither Python nor of a kind below."""

KINDS = [
    *(r"gen/scenes/[\w-]+\.toml", r"gen/\w+/[\w.]+\.jinja"),
    r"bench/(\w+/)?[\w.-]+\.toml",
]


def test_the_files_of_a_wheel(wheel):
    files = {name for name in wheel.namelist() if ".dist-info/" not in name}
    python = {name for name in files if name.endswith(".py")}
    ours = (path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    names = {path.relative_to(ROOT).as_posix() for path in ours}
    assert python == {name for name in names if not name.startswith(NOT_INSTALLED)}
    others = files - python
    assert others >= DATA
    assert all(any(re.fullmatch(kind, name) for kind in KINDS) for name in others - DATA)
    data = [
        *(ROOT / "gen" / "scenes").glob("*.toml"),
        *(ROOT / "bench" / "reports").glob("*.toml"),
    ]
    assert {path.relative_to(ROOT).as_posix() for path in data} <= others
    assert {name.partition("/")[0] for name in files} == set(PACKAGES)


def test_a_wheel_brings_the_command_and_what_it_says_of_itself(wheel):
    inside = f"asperity-{VERSION}.dist-info"
    commands = wheel.read(f"{inside}/entry_points.txt").decode()
    assert commands.split() == [
        "[console_scripts]",
        "asperity",
        "=",
        "asperity.command:main",
    ]
    said = message_from_bytes(wheel.read(f"{inside}/METADATA"))
    assert (said["Name"], said["Version"]) == ("asperity", VERSION)
    assert said["License-Expression"] == "BSD-3-Clause"
    assert f"{inside}/licenses/LICENSE" in wheel.namelist()
    assert set(said.get_all("Provides-Extra", [])) == EXTRAS.keys()
    assert said["Description-Content-Type"] == "text/markdown"
    authors = re.search(r"Copyright \(c\) \d+, the (.*)", (ROOT / "LICENSE").read_text())
    assert authors is not None
    assert said["Author"] == f"The {authors[1]}"


def documents() -> list[Path]:
    """Texts for people: of the root, of the manual, of the batch scripts, and the examples."""
    texts = [
        *ROOT.glob("*.md"),
        *(ROOT / "slurm").rglob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
    ]
    return [*texts, *(ROOT / "examples").rglob("*.py"), ROOT / "Makefile"]


@pytest.mark.parametrize(
    "path", documents(), ids=lambda path: path.relative_to(ROOT).as_posix()
)
def test_extras_that_documents_name_exist(path):
    """Those of `pip install`, and those called so: `[learn]`, the extra `learn`."""
    text = path.read_text(encoding="utf-8")
    installed = re.findall(r"(?:install|-e)\b[^\n]*?[\w./*>)-]\[([a-z,]+)\]", text)
    named = re.findall(r"\bextras? `\[?(\w+)\]?`", text)
    extras = {extra for group in [*installed, *named] for extra in group.split(",")}
    assert extras <= EXTRAS.keys()
    assert not re.findall(r"pip install [^\n]*asperity\[", text), "no index has this name"


def text(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def test_the_citation_is_of_this_version():
    yaml = pytest.importorskip("yaml")
    said = yaml.safe_load(text("CITATION.cff"))
    assert said["cff-version"] == "1.2.0"
    assert said["version"] == VERSION
    assert said["license"] == PROJECT["license"]
    assert [each["name"] for each in said["authors"]] == [
        each["name"] for each in PROJECT["authors"]
    ]
    assert said["keywords"] == PROJECT["keywords"]
    _, _, released = versions_of_the_changelog()[0].partition(" ")
    assert released == f"({said['date-released']})"
    (paper,) = said["references"]
    names = [
        f"{author['given-names'][0]}. {author['family-names']}"
        for author in paper["authors"]
    ]
    wanted = f"{', '.join(names)}: {paper['title']}".lower()
    assert wanted in " ".join(text("docs/references.md").lower().split())


def versions_of_the_changelog() -> list[str]:
    """Titles of the sections of releases; what comes next may stand above them."""
    titles = re.findall(r"^## (.*)$", text("CHANGELOG.md"), flags=re.MULTILINE)
    return titles[1:] if titles[0] == "Not released" else titles


def test_the_changelog_has_a_section_for_each_version_the_newest_first():
    sections = versions_of_the_changelog()
    assert sections[0].split()[0] == VERSION
    dates = [re.fullmatch(r"\d\S* \((\d{4}-\d\d-\d\d)\)", each) for each in sections]
    days = [date[1] for date in dates if date]
    assert len(days) == len(sections)
    assert days == sorted(days, reverse=True)


def test_the_table_of_extras_is_whole():
    listed = re.findall(r"^\| `(\w+)` \|", text("docs/install.md"), flags=re.MULTILINE)
    assert set(listed) == EXTRAS.keys() - {"suite", "test", "docs"}


def test_the_table_of_formats_is_that_of_the_code():
    table = re.findall(
        r"^\| (\w+)[^|]*\|[^|]*\| (\d+) \| (.*) \|", text("docs/compatibility.md"), re.M
    )
    assert table == [
        ("database", str(schema.SCHEMA), str(schema.SCHEMA)),
        ("part", str(schema.PART), str(schema.PART)),
        ("results", str(schema.PHYSICS), f"any; continued only with {schema.PHYSICS}"),
        ("surrogate", str(FORMAT), f"{WITHOUT_POWERS}, {FORMAT}"),
    ]


def test_names_that_stay_are_there():
    section = text("docs/compatibility.md").split("**Python.**")[1].split("\n## ")[0]
    names = re.findall(r"`((?:bem|gen|learn|asperity)\.[\w.]+)`", section)
    assert len(names) > 8
    for name in names:
        assert pkgutil.resolve_name(name) is not None


def test_a_clone_is_named_by_its_path():
    assert f"pip install -e '{ROOT}[plot]'" in installation.command_for("plot").replace(
        f"{sys.executable} -m ", ""
    )


def test_beside_a_clone_no_index_is_asked(monkeypatch, tmp_path):
    """Whoever asks an index for `asperity` may get somebody else's."""
    monkeypatch.setattr(installation, "REPOSITORY", tmp_path)
    assert (
        installation.command_for("learn")
        == "install Asperity again, with its extra 'learn'"
    )


def test_messages_name_extras_that_there_are():
    sources = [
        path for name in ("gen", "learn", "bench") for path in (ROOT / name).rglob("*.py")
    ]
    texts = "".join(path.read_text(encoding="utf-8") for path in sources)
    named = set(re.findall(r"""command_for\(['"](\w+)""", texts)) | {
        *command_line.EXTRAS.values()
    }
    assert (
        {"mpi", "mpich", "plot", "learn", "instruments", "bench"}
        <= named
        <= EXTRAS.keys()
    )


@pytest.mark.parametrize("module", command_line.EXTRAS)
def test_the_extra_of_a_module_brings_it(module):
    names = {"sklearn": "scikit-learn", "tomli_w": "tomli-w", "xgboost": "xgboost-cpu"}
    wanted = names.get(module, module).lower()
    libraries = EXTRAS[command_line.EXTRAS[module]]
    assert wanted in {re.split(r"[<>=;\s]", each)[0].lower() for each in libraries}


def test_every_library_is_always_there_or_of_an_extra():
    """Without it a command says what to install; mpi4py has words of its own."""
    needed = [re.split(r"[<>=]", each)[0] for each in PROJECT["dependencies"]]
    # What comes with those that need it.
    beside = {"PIL", "cycler", "joblib", "pydantic_core", "markupsafe"}
    known = {*needed, *command_line.EXTRAS, *beside, "mpi4py", *PACKAGES}
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            if (
                path.parent.name == "suites"
            ):  # run by pytest, with the extra that brings it
                continue
            strangers = set(imports(path)) - known - set(sys.stdlib_module_names)
            assert not strangers, f"{path}: {strangers}"


def test_no_message_names_a_distribution_that_no_index_has():
    """`pip install` is followed by a path, by an expression, or by a name that is listed here."""
    known = {"tamaas", "ContactMechanics", "aspher,", "them"}
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            named = set(re.findall(r"pip install[\"' ]+([^\s\"']+)", text))
            assert named <= known, f"{path}: {named - known}"


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no checkout of git")
def test_the_commit_is_that_of_the_checkout():
    asked = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert installation.git_commit() == asked.stdout.strip()


def test_the_page_on_installing_names_the_wheel_of_this_version():
    named = re.findall(r"asperity-(\S+?)-py3-none-any\.whl", text("docs/install.md"))
    assert named == [VERSION]


def test_the_recipe_asks_for_what_the_package_asks_for():
    recipe = (ROOT / "recipe" / "recipe.yaml").read_text(encoding="utf-8")
    assert f'version: "{VERSION}"' in recipe
    run = recipe.partition("  run:\n")[2].partition("  run_constraints:")[0]
    wanted = [line.strip(" -").replace(" ", "") for line in run.splitlines()][1:]
    assert wanted == PROJECT["dependencies"]
    (command,) = PROJECT["scripts"].items()
    assert " = ".join(command) in recipe
    for name in ("Containerfile", "asperity.def"):
        text = (ROOT / "recipe" / name).read_text(encoding="utf-8")
        (extras,) = re.findall(r"/source\[(.*)\]", text)
        assert set(extras.split(",")) <= set(EXTRAS)
        assert re.search(rf'image\.version[= "]+{re.escape(VERSION)}\b', text)
