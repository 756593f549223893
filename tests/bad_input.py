"""Everything wrong that a user can type, and a word that the one-line answer has to hold."""

from pathlib import Path

import h5py
import numpy as np

SPECTRAL = (
    "samples = 3\n[surface]\ngenerator = 'spectral'\nroll_off = 90.0\nnodes = 20\nside = 90.0\n"
)
PYTHON = "samples = 3\n[surface]\ngenerator = 'python'\nfunction = "
PRESSURE = "samples = 3\n[load]\nquantity = 'pressure'\n"
GOOD_SCENE = "samples = 24\n[surface]\nnodes = 17\n"

SCENES: dict[str, tuple[str, str]] = {
    "empty": ("", "empty"),
    "comments": ("# nothing\n", "empty"),
    "syntax": ("samples = = 3", "TOML"),
    "twice": ("samples = 3\nsamples = 4", "TOML"),
    "no-samples": ("seed = 3", "samples"),
    "unknown-key": ("samples = 3\nsample_per_surface = 2", "samples_per_surface"),
    "unknown-table": ("samples = 3\n[surfaces]\nnodes = 17", "surface"),
    "unknown-inner": ("samples = 3\n[surface]\nnode = 17", "surface.node"),
    "samples-text": ('samples = "many"', "many"),
    "samples-float": ("samples = 3.5", "3.5"),
    "samples-bool": ("samples = true", "true"),
    "samples-zero": ("samples = 0", "samples = 0"),
    "samples-negative": ("samples = -3", "-3"),
    "samples-huge": ("samples = 10000000000", "10000000000"),
    "per-surface-zero": ("samples = 3\nsamples_per_surface = 0", "samples_per_surface"),
    "seed-negative": ("samples = 3\nseed = -1", "seed"),
    "hurst-high": ("samples = 3\n[surface]\nhurst = [0.5, 1.5]", "1.5"),
    "hurst-order": ("samples = 3\n[surface]\nhurst = [0.8, 0.5]", "hurst"),
    "hurst-number": ("samples = 3\n[surface]\nhurst = 1.8", "hurst"),
    "hurst-three": ("samples = 3\n[surface]\nhurst = [0.5, 0.6, 0.7]", "hurst"),
    "hurst-nan": ("samples = 3\n[surface]\nhurst = [nan, 0.7]", "hurst"),
    "sigma-negative": ("samples = 3\n[surface]\nsigma0 = [-1.0, 1.0]", "sigma0"),
    "sigma-infinite": ("samples = 3\n[surface]\nsigma0 = [1.0, inf]", "sigma0"),
    "side-zero": ("samples = 3\n[surface]\nside = 0", "side = 0"),
    "side-negative": ("samples = 3\n[surface]\nside = -5.0", "side"),
    "nodes-even": ("samples = 3\n[surface]\nnodes = 128", "nodes = 128"),
    "nodes-two": ("samples = 3\n[surface]\nnodes = 2", "nodes = 2"),
    "nodes-float": ("samples = 3\n[surface]\nnodes = 129.0", "129.0"),
    "against-itself": ('samples = 3\n[surface]\nagainst = "itself"', "another"),
    "against-flag": ("samples = 3\n[surface]\nagainst = true", "against"),
    "generator": ('samples = 3\n[surface]\ngenerator = "perlin"', "perlin"),
    "delta-nan": (
        "samples = 3\n[delta]\npieces = [{share = 1.0, range = [nan, 3.0]}]",
        "delta.pieces[0].range",
    ),
    "delta-shares": (
        "samples = 3\n[delta]\npieces = [{share = 0.5, range = [1.0, 3.0]}]",
        "0.5",
    ),
    "delta-negative": (
        "samples = 3\n[delta]\npieces = [{share = 1.0, range = [-1.0, 3.0]}]",
        "range",
    ),
    "delta-none": ("samples = 3\n[delta]\npieces = []", "pieces"),
    "spectral-alone": (SPECTRAL, "surface.cut_off is missing"),
    "spectral-no-rms": (f"{SPECTRAL}cut_off = 20.0", "give either rms_height or rms_slope"),
    "spectral-fine": (
        f"{SPECTRAL}cut_off = [5.0, 20.0]\nrms_height = 1.0",
        "this grid holds waves of 9.47368 um and more",
    ),
    "spectral-long": (
        f"{SPECTRAL.replace('90.0', '95.0', 1)}cut_off = 95.0\nrms_height = 1.0\nperiod = 1.0",
        "the longest wave of the period 94.7368 um",
    ),
    "spectral-roll-off": (f"{SPECTRAL}cut_off = 95.0\nrms_height = 1.0", "the shorter wavelength"),
    "spectral-key": (f"{SPECTRAL}cut_off = 20.0\nrms_height = 1.0\nsigma0 = 3.0", "sigma0"),
    "normal-beyond": (
        f"{SPECTRAL}cut_off = 20.0\nrms_height = {{ normal = [1.0, 1.0] }}",
        "its values are -2 to 4",
    ),
    "normal-key": (f"{SPECTRAL}cut_off = 20.0\nrms_height = {{ norml = [1.0, 1.0] }}", "normal"),
    "choice-shares": (
        "samples = 3\n[surface]\nhurst = { choice = [0.5, 0.6], shares = [0.5, 0.6] }",
        "the shares sum to 1.1",
    ),
    "too-wide": ("samples = 3\n[surface]\nsigma0 = { log_uniform = [1e-320, 1e308] }", "too wide"),
    "python-alone": ("samples = 3\n[surface]\ngenerator = 'python'", "surface.function is missing"),
    "python-no-module": (f"{PYTHON}'no_such_module_here:waves'", "no module no_such_module_here"),
    "python-no-function": (f"{PYTHON}'no_waves:waves'", "no_waves.py has no function waves"),
    "python-broken": (f"{PYTHON}'broken_waves:waves'", "SyntaxError"),
    "python-raises": (f"{PYTHON}'no_waves:raises'", "surface 0: KeyError: 'waves'"),
    "python-shape": (f"{PYTHON}'no_waves:flat'", "heights are of shape (2, 2), not (128, 128)"),
    "python-nothing": (f"{PYTHON}'no_waves:nothing'", "returned nothing, not heights"),
    "python-leaves": (f"{PYTHON}'no_waves:leaves'", "surface 0: SystemExit: 0"),
    "python-argument": (f"{PYTHON}'no_waves:flat'\nparameters = {{ rng = 1.0 }}", "parameters.rng"),
    "python-unknown": (f"{PYTHON}'no_waves:flat'\nparameters = {{ a = 1.0 }}", "TypeError: flat()"),
    "python-column": (f"{PYTHON}'no_waves:flat'\nparameters = {{ force = 1.0 }}", "own_force"),
    "load-and-delta": (f"{PRESSURE}range = 1.0\n[delta]", "[delta] and [load]"),
    "load-twice": (
        f"{PRESSURE}range = 1.0\npieces = [{{share = 1.0, range = 1.0}}]",
        "range and pieces are both given",
    ),
    "load-none": (PRESSURE, "load.pieces is missing; allowed: range = [low, high], or pieces"),
    "load-quantity": ("samples = 3\n[load]\nquantity = 'weight'\nrange = 1.0", "weight"),
    "load-compliant": (
        f"{PRESSURE}range = 1.0\n[contact]\nfar_field = 'compliant'",
        "needs contact.far_field = 'rigid'",
    ),
    "load-hardness": (
        f"{PRESSURE}range = [5.0, 6.0]\n[contact]\nhardness = [3.0, 5.0]",
        "carries less than 5 MPa",
    ),
    "store-function": ("samples = 3\n[store]\nfunction = 'no_waves'", "'module:function'"),
    "store-raises": ("samples = 3\n[store]\nfunction = 'no_waves:fails'", "row 0: KeyError"),
    "store-text": (
        "samples = 3\n[store]\nfunction = 'no_waves:text'",
        "a is 'three', not a number",
    ),
    "store-column": (
        "samples = 3\n[store]\nfunction = 'no_waves:text'\noutputs = { delta = 'um' }",
        "own_delta",
    ),
    "store-outputs": ("samples = 3\n[store]\noutputs = { a = '1' }", "needs function"),
    "kernel": ('samples = 3\n[contact]\nkernel = "point"', "point"),
    "far-field": ('samples = 3\n[contact]\nfar_field = "soft"', "soft"),
    "spacing": ('samples = 3\n[contact]\nspacing = "L/n"', "L/n"),
    "boundary": ('samples = 3\n[contact]\nboundary = "open"', "open"),
    "boundary-spacing": (
        'samples = 3\n[contact]\nboundary = "mirror"\nspacing = "side/(n-1)"',
        "needs spacing = 'side/n'",
    ),
    "modulus-zero": ("samples = 3\n[contact]\nmodulus = 0.0", "modulus"),
    "poisson-high": ("samples = 3\n[contact]\npoisson = 0.6", "0.6"),
    "rtol-zero": ("samples = 3\n[contact]\nrtol = 0.0", "rtol"),
    "iterations-zero": ("samples = 3\n[contact]\nmax_iterations = 0", "max_iterations"),
    "store-heights": ('samples = 3\n[store]\nheights = "yes"', "heights"),
}

SURFACES: dict[str, np.ndarray] = {
    "nan": np.array([[0.0, np.nan], [1.0, 2.0]]),
    "infinite": np.array([[0.0, np.inf], [1.0, 2.0]]),
    "one-row": np.zeros((1, 9)),
    "complex": np.zeros((9, 9), dtype=complex),
    "empty": np.zeros((0, 0)),
    "line": np.zeros(9),
    "cube": np.zeros((3, 3, 3)),
    "words": np.array([["a", "b"], ["c", "d"]]),
}

TEXTS = {"ragged.txt": "1 2 3\n4 5\n", "prose.txt": "once upon a time\n", "empty.txt": ""}


MODULES = {
    "broken_waves.py": "def waves(:\n",
    "no_waves.py": """import sys
import numpy as np
def raises(shape, spacing, rng):
    return {}["waves"]
def flat(shape, spacing, rng):
    return np.zeros((2, 2))
def nothing(shape, spacing, rng):
    pass
def leaves(shape, spacing, rng):
    sys.exit(0)
def fails(contact):
    return {}["waves"]
def text(contact):
    return {"a": "three"}
""",
}


def prepare(folder: Path) -> None:
    """Write all the files that the cases name."""
    (folder / "good.toml").write_text(GOOD_SCENE)
    for name, (text, _) in SCENES.items():
        (folder / f"{name}.toml").write_text(text)
    (folder / "latin.toml").write_bytes(b"title = '\xe4'\nsamples = 3\n")
    (folder / "directory").mkdir()
    for name, text in MODULES.items():
        (folder / name).write_text(text)
    for name, heights in SURFACES.items():
        np.save(folder / f"{name}.npy", heights)
    for name, text in TEXTS.items():
        (folder / name).write_text(text)
    np.save(folder / "good.npy", np.arange(81.0).reshape(9, 9))
    np.save(folder / "oblong.npy", np.arange(45.0).reshape(9, 5))
    whole = (folder / "good.npy").read_bytes()
    (folder / "truncated.npy").write_bytes(whole[: len(whole) // 2])
    np.save(folder / "pickled.npy", np.array([{}, 1], dtype=object), allow_pickle=True)
    with h5py.File(folder / "foreign.h5", "w") as file:
        file["temperature"] = np.arange(2000.0)
    content = (folder / "foreign.h5").read_bytes()
    (folder / "truncated.h5").write_bytes(content[: len(content) // 2])
    (folder / "empty.h5").write_bytes(b"")
    (folder / "text.h5").write_text("not HDF5\n")


def _cases() -> list[tuple[list[str], str]]:
    cases = [
        (["run", f"{name}.toml", "-o", "x.h5", "--trust"], word)
        for name, (_, word) in SCENES.items()
    ]
    contact, deep = ["--side", "9", "--delta", "1"], ["--side", "9", "--delta", "70"]
    for name in [*(f"{name}.npy" for name in SURFACES), *TEXTS, "truncated.npy", "pickled.npy"]:
        cases.append((["contact", name, *contact], name))
        cases.append((["describe", name, "--side", "9"], name))
    for name in ("foreign.h5", "truncated.h5", "empty.h5", "text.h5", "directory", "good.toml"):
        cases.append((["run", "good.toml", "-o", name], name))
        cases.append((["info", name], name))
        cases.append((["check", name], name))
        cases.append((["merge", name, "-o", "x.h5"], name))
        cases.append((["plot", name, "-o", "x.png"], name))
    return [
        *cases,
        ([], "Missing command"),
        (["rum"], "rum"),
        (["run"], "SCENE"),
        (["run", "quick"], "--output"),
        (["run", "quik", "-o", "x.h5"], "quik"),
        (["run", "latin.toml", "-o", "x.h5"], "UTF-8"),
        (["run", "directory", "-o", "x.h5"], "directory"),
        (["run", "missing.toml", "-o", "x.h5"], "missing.toml"),
        (["run", "good.toml", "-o", "nowhere/x.h5"], "nowhere"),
        (["run", "good.toml", "-o", "x.h5", "--ranks", "3"], "--ranks"),
        (["run", "good.toml", "-o", "x.h5", "--rows", "3"], "--rows"),
        (["run", "good.toml", "-o", "x.h5", "--rows", "9:3"], "--rows"),
        (["run", "good.toml", "-o", "x.h5", "--rows", "0:25"], "--rows"),
        (["run", "empty.toml", "-o", "x.h5", "--dry-run"], "empty"),
        (["estimate", "quik"], "quik"),
        (["estimate", "quick", "--ranks", "0"], "--ranks"),
        (["info", "missing.h5"], "does not exist"),
        (["check", "missing.h5"], "does not exist"),
        (["merge", "missing.h5", "-o", "x.h5"], "missing.h5"),
        (["merge", "-o", "x.h5"], "FILES"),
        (["plot", "missing.h5", "-o", "x.png"], "does not exist"),
        (["contact", "good.npy", "--delta", "1"], "--side"),
        (["contact", "good.npy", "--side", "0", "--delta", "1"], "--side '0'"),
        (["contact", "good.npy", "--side", "1,2,3", "--delta", "1"], "1,2,3"),
        (["contact", "good.npy", "--side", "wide", "--delta", "1"], "wide"),
        (["contact", "good.npy", "--side", "9", "--delta", "nan"], "delta = nan"),
        (["contact", "good.npy", "--side", "9", "--delta", "deep"], "--delta"),
        (["contact", "good.npy", *contact, "--young", "0"], "modulus"),
        (["contact", "good.npy", *contact, "--poisson", "1"], "poisson"),
        (["contact", "good.npy", *contact, "--kernel", "x"], "kernel"),
        (["contact", "good.npy", *contact, "--rtol", "0"], "rtol"),
        (["contact", "good.npy", *contact, "--max-iterations", "0"], "max_iterations"),
        (["contact", "good.npy", *deep, "--max-iterations", "1"], "max_iterations"),
        (["contact", "missing.npy", *contact], "missing.npy"),
        (["describe", "missing.npy", "--side", "9"], "missing.npy"),
        (["describe", "good.npy", "--side", "-9"], "--side"),
        (["describe", "oblong.npy", "--side", "9"], "9,4.5 for square cells or 9,9"),
        (
            ["contact", "good.npy", "--side", "9", "--delta", "99", "--far-field", "compliant"],
            "Delta*",
        ),
    ]


CASES = _cases()
