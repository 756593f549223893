"""Laws as CalculiX uses them: two blocks pressed on each other beside the table of the law.

The blocks touch on one face of a millimetre squared, with the closure, pressure and conductance of
the law between them; each pressure of the law is a step. What CalculiX prints is compared with the
rows of the table: closure and pressure of the contact, and the jump of the temperature across it
beside flux over conductance.
"""

import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np

from bench.files import Row, read_table
from bench.report import Report, remark
from gen.cli import main as gen
from gen.quantities import CLOSURE, CONDUCTANCE, PRESSURE
from gen.runtime.errors import InputError
from gen.runtime.files import make_folder
from gen.surface import generate

YOUNG, CONDUCTIVITY, HOT = 210e3, 50.0, 100.0  # MPa, W/(m K), K
STEEL = (
    "--young",
    f"{YOUNG:g}",
    "--poisson",
    "0.3",
    "--conductivity",
    f"{CONDUCTIVITY:g}",
)
HARDNESSES = (None, 2000.0)  # MPa
PRESSURES = "5:320:7:log"  # MPa
SURFACES = {"Hurst exponent 0.8": (0.8, 129), "Hurst exponent 0.5": (0.5, 129)}
SIDE, SIGMA0 = 200.0, 0.5  # um
ALLOWED = 1.0  # % between the table and CalculiX
LAW = (CLOSURE.in_laws, PRESSURE.in_laws, CONDUCTANCE.in_laws)
QUANTITIES = (CLOSURE.in_laws, PRESSURE.in_laws, "jump_K")
SECONDS = 120.0  # most that CalculiX may take

DECK = Path(__file__).with_name("two-blocks.inp")
"""Two blocks that are pressed on each other in one step, as the manual shows them."""

DOWN = "TOP, 3, 3, -0.001"
"""Its line that pushes the top down [mm]."""


def pressed(folder: Path, law: Sequence[Mapping[str, float]]) -> list[Row]:
    """Press two blocks with CalculiX by rows of a law; its files `joint` are in a folder.

    Return for each row of the law its closure [um], pressure [MPa] and the jump of temperature that
    its conductance asks for [K], those of CalculiX with the end `_calculix`, and by how much they
    are off with the end `_off` [%]. An InputError is raised if there is no CalculiX, or it fails.
    """
    if shutil.which("ccx") is None:
        raise InputError("there is no CalculiX (ccx): apt-get install calculix-ccx")
    downs = [-(1e-3 * row["closure_um"] + 2 * row["pressure_MPa"] / YOUNG) for row in law]
    model, word, step = DECK.read_text(encoding="utf-8").partition("*STEP")
    steps = ((word + step).replace(DOWN, f"TOP, 3, 3, {down:.12g}") for down in downs)
    (folder / "blocks.inp").write_text(model + "".join(steps), encoding="utf-8")
    done = subprocess.run(
        ["ccx", "blocks"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    if done.returncode:
        raise InputError(
            f"CalculiX failed with code {done.returncode}: {done.stdout[-200:]!r}"
        )
    return _compared(law, (folder / "blocks.dat").read_text(encoding="utf-8"))


def _compared(law: Sequence[Mapping[str, float]], printed: str) -> list[Row]:
    """Return the rows of `pressed` from what CalculiX has printed: five lines of numbers a step."""
    lines = [
        [float(number) for number in line.split()]
        for line in printed.splitlines()
        if re.fullmatch(r"[-+ 0-9.E]+", line) and line.strip()
    ]
    if len(lines) != 5 * len(law):
        raise InputError(f"CalculiX printed {len(lines)} lines for {len(law)} steps")
    rows = []
    for step, row in enumerate(law):
        low, high, cold, warm, force = lines[5 * step : 5 * step + 5]
        flux = CONDUCTIVITY * (HOT - warm[1])  # mW / mm2
        wanted = {
            CLOSURE.in_laws: row["closure_um"],
            PRESSURE.in_laws: row["pressure_MPa"],
            "jump_K": flux / (1e3 * row["conductance_W_per_mm2_K"]),
        }
        found = (1e3 * (low[3] - high[3]), -force[2], warm[1] - cold[1])
        both = list(zip(QUANTITIES, found, strict=True))
        theirs = {f"{name}_calculix": each for name, each in both}
        off = {f"{name}_off": 100 * (each / wanted[name] - 1) for name, each in both}
        rows.append(wanted | theirs | off)
    return rows


def calculix(folder: Path) -> Report:
    """Compute the laws of all surfaces and hardnesses, and press each in CalculiX."""
    rows: list[Row] = []
    for (name, (hurst, nodes)), hardness in (
        (s, h) for s in SURFACES.items() for h in HARDNESSES
    ):
        home = (
            folder
            / "decks"
            / f"hurst-{hurst:g}-{'elastic' if hardness is None else 'yielding'}"
        )
        for row in pressed(home, law_of(home, hurst, nodes, hardness)):
            near = all(abs(row[f"{each}_off"]) <= ALLOWED for each in QUANTITIES)
            said = {"surface": name, "hardness_MPa": hardness or "", **row}
            rows.append(said | {"verdict": "passed" if near else "failed"})
        remark(f"{name}, hardness {hardness}: pressed")
    passed = sum(row["verdict"] == "passed" for row in rows)
    text = f"{passed} of {len(rows)} steps within {ALLOWED:g} % of the table"
    return Report({"calculix": rows}, text=text)


def law_of(
    folder: Path, hurst: float, nodes: int, hardness: float | None
) -> list[dict[str, float]]:
    """Write the files of a law by `gen law` into a folder, and return the rows that count.

    The first row, without load, and the last are left out: CalculiX needs points on both sides.
    """
    make_folder(folder)
    heights = generate("diamond-square", nodes, hurst, SIGMA0, np.random.default_rng(0))
    np.save(folder / "surface.npy", heights)
    yields = () if hardness is None else ("--hardness", f"{hardness:g}")
    path = folder / "joint"
    given = (f"{folder / 'surface.npy'}", "--side", f"{SIDE:g}", "--pressure", PRESSURES)
    with redirect_stdout(StringIO()):
        code = gen(["law", *given, *STEEL, *yields, "-o", f"{path}"])
    if code:
        raise InputError(f"{path}: gen law failed with code {code}")
    table = read_table(path.with_suffix(".csv"))[1]
    rows = [row for row in table if row["against"] == "pressure_MPa"]
    return [{name: float(row[name]) for name in LAW} for row in rows[1:-1]]
