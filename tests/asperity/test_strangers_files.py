"""Files of strangers: no command that reads them runs, imports or opens code that they name."""

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import audited
import numpy as np
import pytest
import user_functions

from gen.database import Writer, create
from gen.generation.completion import completed
from gen.generation.sample import compute_rows
from gen.runtime.errors import SourceError
from gen.runtime.user_code import load_function, source_hash
from gen.scene import Scene
from learn import cli

EVIL = "open('ran', 'w').close()\ndef waves(*_, **__): pass\nspots = interact = waves\n"
HOSTILE = {
    "package": "evil.sub:waves",  # its hash is right: all that it lacks is the user's trust
    "changed": "evil.changed:waves",
    "library": "this:s",  # a module of Python's that does something when it is imported
    "outputs": "evil.sub:spots",
}
"""Function that each database names."""

FEW = [("package", name) for name in ("info", "check", "plot", "run", "gen-law")]
OUTWARD = ("socket.connect", "socket.sendto", "os.")
ROWS = 40
SPECTRAL = """[surface]
generator = "spectral"
nodes = [20, 24]
side = [200.0, 300.0]
roll_off = 200.0
cut_off = 50.0
rms_slope = [0.05, 0.1]
"""

NEED_SURFACES = {
    "check": ["gen", "check", "{}.h5"],
    "plot": ["gen", "plot", "{}.h5", "-o", "{}.png"],
    "run": ["gen", "run", "{}.toml", "-o", "{}-new.h5"],
    "dry-run": ["gen", "run", "{}.toml", "-o", "{}-new.h5", "--dry-run"],
    "resume": ["gen", "run", "{}.toml", "-o", "{}.h5"],
    "estimate": ["gen", "estimate", "{}.toml"],
    "gen-law": ["gen", "law", "{}.h5", "--delta", "0.5", "--surfaces", "2"],
    "scene-law": ["gen", "law", "{}.toml", "--delta", "0.5", "--surfaces", "2"],
    "fit-hybrid": ["learn", "fit", "{}.h5", "--features", "hybrid", "-o", "{}-hybrid"],
    "grow": ["learn", "grow", "{}.toml", "-o", "{}-grown", "--budget", "5s"],
    "serve": ["serve", "{}.toml"],
    "serve-surrogate": ["serve", "{}.surrogate"],
    "predict-law": [
        "learn",
        "law",
        "{}.surrogate",
        "{}.h5",
        "--delta",
        "0.5",
        "--interval",
        "0.5",
    ],
    **{
        name: ["learn", name, "{}.h5", "--features", "hybrid", "-o", "{}-" + name]
        for name in ("compare", "tune", "importance")
    },
}
"""Commands that need surfaces: refused unless the user trusts the function."""

PREDICTED = ["--delta", "1", "--side", "200,300", "--interval", "0.5"]
READ = {
    "info": ["gen", "info", "{}.h5"],
    "check-0": ["gen", "check", "{}.h5", "--recompute", "0"],
    "merge": ["gen", "merge", "{}.h5", "-o", "{}-merged.h5"],
    "export": ["gen", "export", "{}.h5", "-o", "{}-exported"],
    "fit": ["learn", "fit", "{}.h5", "--features", "paper", "-o", "{}-again"],
    "compare-paper": [
        "learn",
        "compare",
        "{}.h5",
        "--model",
        "kernel-ridge",
        "-o",
        "{}-compared",
    ],
    "card": ["learn", "card", "{}.surrogate"],
    "predict": ["learn", "predict", "{}.surrogate", "heights.npy", *PREDICTED],
}
"""Commands that read what is stored."""

FREE = {"outputs": {"plot", "gen-law", "scene-law", "fit-hybrid", "predict-law"}}
"""Commands that need surfaces, but no outputs of the user's function: they work."""

LONG = {"outputs": {"serve-surrogate", "compare", "tune", "importance"}}
"""Commands that would work too, for long or without an end."""

CASES = [
    (kind, name)
    for kind in HOSTILE
    for name in (*NEED_SURFACES, *READ)
    if name not in LONG.get(kind, ())
]


def scene_text(kind, function):
    """A scene that names a function, with the hash of its source, as databases and exports do."""
    module = Path(*function.partition(":")[0].split(".")).with_suffix(".py")
    content = module.read_bytes() if module.exists() else b"what the hash is of"
    named = f"function = '{function}'\nsource = '{hashlib.sha256(content).hexdigest()}'\n"
    surface = user_functions.SURFACE.replace('function = "mine:waves"\n', named)
    if kind == "outputs":
        outputs = "outputs = { top = 'um', spots = '1', mean_pressure = 'uN' }\n"
        surface = f"{SPECTRAL}[store]\n{named}{outputs}"
    return f"samples = {ROWS}\n{surface}"


def make(kind, *, surrogate):
    """Write a stranger's scene, database and surrogate; the rows come from a harmless function."""
    Path(f"{kind}.toml").write_text(scene_text(kind, HOSTILE[kind]))
    scene = Scene.parse(Path(f"{kind}.toml").read_text(), kind)
    harmless = scene_text(kind, "mine:spots" if kind == "outputs" else "mine:waves")
    create(Path(f"{kind}.h5"), scene)
    with Writer(Path(f"{kind}.h5"), scene) as writer:
        writer.write_block(
            0, ROWS, compute_rows(completed(Scene.parse(harmless, kind)), 0, ROWS)
        )
    if surrogate:
        fit = ["fit", f"{kind}.h5", "--features", "paper", "-o", f"{kind}.surrogate"]
        assert cli.main(fit) == 0


def reports_of(folder, cases):
    """What the command of each case does, all in one process of their own."""
    with pytest.MonkeyPatch.context() as patch, user_functions.inside(folder, patch, ""):
        for name in ("__init__", "sub", "changed"):
            path = folder / "evil" / f"{name}.py"
            path.parent.mkdir(exist_ok=True)
            path.write_text(EVIL)
        for kind in dict.fromkeys(kind for kind, _ in cases):
            make(kind, surrogate=cases == CASES)
        (folder / "evil" / "changed.py").write_text(f"{EVIL}# changed\n")
        np.save("heights.npy", np.random.default_rng(1).random((20, 24)))
    lines, report = folder / "lines.json", folder / "report.json"
    words = {**NEED_SURFACES, **READ}
    lines.write_text(
        json.dumps(
            [[word.replace("{}", kind) for word in words[name]] for kind, name in cases]
        )
    )
    child = [sys.executable, "-P", audited.__file__, str(lines), str(report)]
    subprocess.run(child, cwd=folder, check=True, stdin=subprocess.DEVNULL, timeout=300)
    assert not (folder / "ran").exists()
    return dict(zip(cases, json.loads(report.read_text()), strict=True))


@pytest.fixture(scope="module")
def reports_of_all(tmp_path_factory):
    return reports_of(tmp_path_factory.mktemp("all"), CASES)


def require_harmless(case, code, said, events):
    """The command imported, ran and opened nothing that the file names, and says what is needed."""
    kind, name = case
    module = HOSTILE[kind].partition(":")[0]
    wanted = {f"import {module}", "import evil"}
    assert not [
        each for each in events if each in wanted or "evil" in each.partition(" ")[2]
    ]
    assert not [each for each in events if each.startswith(OUTWARD)]
    refused = name in NEED_SURFACES and name not in FREE.get(kind, ())
    assert code == (2 if refused else 0), said
    if refused:
        assert HOSTILE[kind] in said
        assert ("--trust" in said) == (name != "serve-surrogate")


def test_nothing_that_a_database_names_runs(tmp_path):
    for case, report in reports_of(tmp_path, FEW).items():
        require_harmless(case, *report)


@pytest.mark.long
@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_nothing_that_a_file_names_is_imported_run_or_opened(reports_of_all, case):
    require_harmless(case, *reports_of_all[case])


def test_a_trusted_function_is_compared_with_its_hash_before_its_package_runs(
    tmp_path, monkeypatch
):
    (tmp_path / "evil").mkdir()
    for name in ("__init__", "sub"):
        (tmp_path / "evil" / f"{name}.py").write_text(EVIL)
    with user_functions.inside(tmp_path, monkeypatch, ""):
        with pytest.raises(SourceError, match="has changed"):
            load_function("evil.sub:waves", 64 * "0")
        assert not Path("ran").exists()
        load_function("evil.sub:waves", source_hash("evil.sub:waves"))
        assert Path("ran").exists()
    for name in ("evil", "evil.sub"):
        sys.modules.pop(name)
