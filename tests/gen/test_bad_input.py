"""Bad scenes and surfaces are one clear line and exit code 2; nothing is written.

tests/command_lines.py has bad files and options of every command, for several ranks.
"""

import h5py
import numpy as np
import pytest

from gen import cli

SPECTRAL = (
    "samples = 3\n[surface]\ngenerator = 'spectral'\nroll_off = 90.0\nnodes = 20\nside = 90.0\n"
)
PYTHON = "samples = 3\n[surface]\ngenerator = 'python'\nfunction = "
PRESSURE = "samples = 3\n[load]\nquantity = 'pressure'\n"

SCENES = {
    "twice": ("samples = 3\nsamples = 4", "TOML"),
    "spectral-no-rms": (f"{SPECTRAL}cut_off = 20.0", "give either rms_height or rms_slope"),
    "spectral-roll-off": (f"{SPECTRAL}cut_off = 95.0\nrms_height = 1.0", "the shorter wavelength"),
    "normal-beyond": (
        f"{SPECTRAL}cut_off = 20.0\nrms_height = {{ normal = [1.0, 1.0] }}",
        "its values are -2 to 4",
    ),
    "choice-shares": (
        "samples = 3\n[surface]\nhurst = { choice = [0.5, 0.6], shares = [0.5, 0.6] }",
        "the shares sum to 1.1",
    ),
    "too-wide": ("samples = 3\n[surface]\nsigma0 = { log_uniform = [1e-320, 1e308] }", "too wide"),
    "python-alone": ("samples = 3\n[surface]\ngenerator = 'python'", "surface.function is missing"),
    "python-leaves": (f"{PYTHON}'no_waves:leaves'", "surface 0: SystemExit: 0"),
    "python-column": (f"{PYTHON}'no_waves:leaves'\nparameters = {{ force = 1.0 }}", "own_force"),
    "load-twice": (
        f"{PRESSURE}range = 1.0\npieces = [{{share = 1.0, range = 1.0}}]",
        "range and pieces are both given",
    ),
    "load-none": (PRESSURE, "load.pieces is missing; allowed: range = [low, high], or pieces"),
    "load-hardness": (
        f"{PRESSURE}range = [5.0, 6.0]\n[contact]\nhardness = [3.0, 5.0]",
        "carries less than 5 MPa",
    ),
    "store-text": (
        "samples = 3\n[store]\nfunction = 'no_waves:text'",
        "a is 'three', not a number",
    ),
    "store-outputs": ("samples = 3\n[store]\noutputs = { a = '1' }", "needs function"),
    "store-column": (
        "samples = 3\n[store]\nfunction = 'no_waves:text'\noutputs = { delta = 'um' }",
        "own_delta",
    ),
}
"""Scenes, and a word that the line which refuses each of them has to hold."""

SURFACES = {"complex": np.zeros((9, 9), dtype=complex)}

MODULE = """def text(contact):
    return {"a": "three"}
def leaves(shape, spacing, rng):
    raise SystemExit(0)
"""

CONTACT = ["contact", "good.npy", "--side", "9", "--delta", "1"]
AGAINST = ["good.npy", "--side", "9", "--against", "good.npy"]
LINES = [
    *(
        (["run", f"{name}.toml", "-o", "x.h5", "--trust"], word)
        for name, (_, word) in SCENES.items()
    ),
    *((["describe", f"{name}.npy", "--side", "9"], f"{name}.npy") for name in SURFACES),
    (["run", "quick", "-o", "foreign.h5"], "foreign.h5"),
    (["info", "foreign.h5"], "foreign.h5"),
    ([*CONTACT, "--force", "1"], "give one of --delta, --force and --pressure"),
    (["describe", "good.npy", "--side", "0"], "give the scan length"),
    (["describe", "good.npy", "--side", "9", "--crop", "5"], "give x0:x1,y0:y1"),
    (["describe", "good.npy", "--side", "9", "--against-options", "--fill"], "needs --against"),
    (["describe", *AGAINST, "--shift", "0,99"], "fewer than 2 x 2 nodes lie on both maps"),
    (["describe", "oblong.npy", "--side", "9"], "9,4.5 for square cells or 9,9"),
    ([*CONTACT, "--delta", "70", "--max-iterations", "1"], "max_iterations"),
    ([*CONTACT, "--delta", "99", "--far-field", "compliant"], "Delta*"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bad")
    for name, (text, _) in SCENES.items():
        (folder / f"{name}.toml").write_text(text)
    (folder / "no_waves.py").write_text(MODULE)
    for name, heights in SURFACES.items():
        np.save(folder / f"{name}.npy", heights, allow_pickle=True)
    np.save(folder / "good.npy", np.arange(81.0).reshape(9, 9))
    np.save(folder / "oblong.npy", np.arange(45.0).reshape(9, 5))
    with h5py.File(folder / "foreign.h5", "w") as file:
        file["temperature"] = np.arange(2000.0)
    return folder


@pytest.mark.parametrize(("arguments", "word"), LINES, ids=[" ".join(line) for line, _ in LINES])
def test_bad_input_is_one_line_and_exit_code_2(folder, monkeypatch, capsys, arguments, word):
    monkeypatch.chdir(folder)
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert cli.main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert word in captured.err
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before
