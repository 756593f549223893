"""Laws as CalculiX uses them: two blocks pressed on each other, beside the table of the law.

The blocks touch on one face of a square millimetre. Their contact has the law: pressure and
conductance against the closure. Each pressure of the law is a step of CalculiX. The results of a
step are compared with a row of the table: the closure and the pressure of the contact, and the jump
of the temperature across it. The jump by the table is the flux over the conductance.
"""

import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from itertools import product
from pathlib import Path

import numpy as np

from bench.files import Row, read_table
from bench.report import Report, remark
from gen.cli import main as gen
from gen.quantities import CLOSURE, CONDUCTANCE, PRESSURE
from gen.runtime.errors import InputError
from gen.runtime.files import make_folder
from gen.surface import generate

YOUNG = 210e3
"""Young's modulus of the blocks, as in `two-blocks.inp` [MPa]."""

CONDUCTIVITY = 50.0
"""Thermal conductivity of the blocks, as in `two-blocks.inp` [W/(m K)]."""

HOT = 100.0
"""Temperature of the top above that of the bottom, which is 0, as in `two-blocks.inp` [K]."""

STEEL = (
    "--young",
    f"{YOUNG:g}",
    "--poisson",
    "0.3",
    "--conductivity",
    f"{CONDUCTIVITY:g}",
)
"""Options of `gen law` for the material of the blocks."""

HARDNESSES = (None, 2000.0)
"""Hardnesses of the laws [MPa]; None for elastic bodies."""

PRESSURES = "5:320:7:log"
"""Pressures of the laws in the form of the option of `gen law` [MPa]."""


@dataclass(frozen=True)
class LawSurface:
    """The surface of a law, which `gen.surface.generate` makes."""

    name: str  # name in the table
    hurst: float  # Hurst exponent [1]
    nodes: int  # nodes a side


SURFACES = (
    LawSurface("Hurst exponent 0.8", hurst=0.8, nodes=129),
    LawSurface("Hurst exponent 0.5", hurst=0.5, nodes=129),
)
"""The surfaces of the laws."""

SIDE = 200.0
"""Scan length of the surfaces [um]."""

SIGMA0 = 0.5
"""Standard deviation of the first displacement of the surfaces [um]."""

ALLOWED = 1.0
"""Largest difference between the table and CalculiX that passes [%]."""

LAW = (CLOSURE.in_laws, PRESSURE.in_laws, CONDUCTANCE.in_laws)
"""Columns of the table of a law that the comparison needs [um, MPa, W/(mm2 K)]."""

QUANTITIES = (CLOSURE.in_laws, PRESSURE.in_laws, "jump_K")
"""Quantities that are compared, by their columns [um, MPa, K]."""

SECONDS = 120.0
"""Wall time after which CalculiX is ended, as it hangs [s]."""

DECK = Path(__file__).with_name("two-blocks.inp")
"""Input of two blocks that are pressed on each other in one step, as the manual shows it."""

DOWN = "TOP, 3, 3, -0.001"
"""Line of `DECK` that sets the displacement of the top [mm]; `pressed` replaces its number in each
step."""

LINES = 5
"""Number of lines of numbers that CalculiX prints for each step."""


def pressed(folder: Path, law: Sequence[Mapping[str, float]]) -> list[Row]:
    """Press two blocks with CalculiX, in one step for each row of a law.

    Writes `blocks.inp` into the folder. CalculiX writes its results, `blocks.*`, beside it.

    Parameters
    ----------
    folder : Path
        Folder with the files of the law, `joint.*`, which the input includes.
    law : sequence of mapping
        Rows of the law with the columns `LAW`.

    Returns
    -------
    list of Row
        A row for each row of the law. The columns `QUANTITIES` are the closure [um] and pressure
        [MPa] of the law, and the jump of temperature by its conductance [K]. Columns with the
        ending `_calculix` are the results of CalculiX; columns with the ending `_off` are their
        differences from the law [%].

    Raises
    ------
    InputError
        If CalculiX is not installed, or fails, or prints another number of lines.
    subprocess.TimeoutExpired
        If CalculiX takes longer than `SECONDS`.
    """
    if shutil.which("ccx") is None:
        raise InputError("there is no CalculiX (ccx): apt-get install calculix-ccx")
    model, word, step = DECK.read_text(encoding="utf-8").partition("*STEP")
    deck = model
    for row in law:
        # The top moves by the shortening of both blocks of 1 mm, and by the closure [mm].
        shortening = 2 * row["pressure_MPa"] / YOUNG
        displacement = -(1e-3 * row["closure_um"] + shortening)
        deck += (word + step).replace(DOWN, f"TOP, 3, 3, {displacement:.12g}")
    (folder / "blocks.inp").write_text(deck, encoding="utf-8")
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
    """Return the rows of `pressed` from the content of the file that CalculiX prints into.

    Raises InputError if it does not have `LINES` lines of numbers for each step.
    """
    lines = [
        [float(number) for number in line.split()]
        for line in printed.splitlines()
        if re.fullmatch(r"[-+ 0-9.E]+", line) and line.strip()
    ]
    if len(lines) != LINES * len(law):
        raise InputError(f"CalculiX printed {len(lines)} lines for {len(law)} steps")
    rows: list[Row] = []
    for step, law_row in enumerate(law):
        first = LINES * step
        # `low` and `high` are the displacements [mm] of a node on the lower and on the upper face,
        # `cold` and `warm` their temperatures [K]. These lines begin with the number of the node.
        # The last line is the force on the contact [N].
        low, high, cold, warm, force = lines[first : first + LINES]
        flux = CONDUCTIVITY * (HOT - warm[1])  # through the upper block of 1 mm [mW/mm2]
        conductance = 1e3 * law_row["conductance_W_per_mm2_K"]  # [mW/(mm2 K)]
        by_law = {
            CLOSURE.in_laws: law_row["closure_um"],
            PRESSURE.in_laws: law_row["pressure_MPa"],
            "jump_K": flux / conductance,
        }
        by_calculix = {
            CLOSURE.in_laws: 1e3 * (low[3] - high[3]),
            PRESSURE.in_laws: -force[2],  # on a face of 1 mm2
            "jump_K": warm[1] - cold[1],
        }
        row: Row = dict(by_law)
        for name in QUANTITIES:
            row[f"{name}_calculix"] = by_calculix[name]
        for name in QUANTITIES:
            ratio = by_calculix[name] / by_law[name]
            row[f"{name}_off"] = 100 * (ratio - 1)
        rows.append(row)
    return rows


def calculix(folder: Path) -> Report:
    """Make the law of each surface and hardness, and press blocks with it in CalculiX.

    Each law has its own folder below `folder/decks`, with the files of the law and of CalculiX.
    Progress is printed on standard error.

    Parameters
    ----------
    folder : Path
        Folder of the report.

    Returns
    -------
    Report
        Table `calculix` with a row for each step, which has a verdict, and a text with the number
        of steps that have passed.

    Raises
    ------
    InputError
        If CalculiX is not installed, or CalculiX or `gen law` fails.
    subprocess.TimeoutExpired
        If CalculiX takes longer than `SECONDS`.
    """
    rows: list[Row] = []
    for surface, hardness in product(SURFACES, HARDNESSES):
        body = "elastic" if hardness is None else "yielding"
        law_folder = folder / "decks" / f"hurst-{surface.hurst:g}-{body}"
        law = law_of(law_folder, surface.hurst, surface.nodes, hardness)
        steps = pressed(law_folder, law)
        rows += [_table_row(surface, hardness, step) for step in steps]
        remark(f"{surface.name}, hardness {hardness}: pressed")
    passed = [row for row in rows if row["verdict"] == "passed"]
    text = f"{len(passed)} of {len(rows)} steps within {ALLOWED:g} % of the table"
    return Report({"calculix": rows}, text=text)


def _table_row(surface: LawSurface, hardness: float | None, step: Row) -> Row:
    """Return a row of the table: surface, hardness [MPa], the row of `pressed`, and the verdict.

    The hardness is "" for elastic bodies. The verdict is "passed" if all differences from the law
    are at most `ALLOWED`, else "failed".
    """
    differences = [abs(step[f"{name}_off"]) for name in QUANTITIES]
    is_near = all(difference <= ALLOWED for difference in differences)
    return {
        "surface": surface.name,
        "hardness_MPa": hardness or "",
        **step,
        "verdict": "passed" if is_near else "failed",
    }


def law_of(
    folder: Path, hurst: float, nodes: int, hardness: float | None
) -> list[dict[str, float]]:
    """Make the law of a surface by `gen law`.

    Makes the folder, and writes `surface.npy` and the files of the law, `joint.*`, into it.

    Parameters
    ----------
    folder : Path
        Folder of the law.
    hurst : float
        Hurst exponent of the surface [1].
    nodes : int
        Nodes a side of the surface, 2^k + 1.
    hardness : float or None
        Hardness [MPa]; None for elastic bodies.

    Returns
    -------
    list of dict
        Rows of the table against pressure, with the columns `LAW`. The first row, without load,
        and the last row are left out: CalculiX interpolates, and needs rows on both sides.

    Raises
    ------
    InputError
        If `gen law` fails.
    """
    make_folder(folder)
    surface = folder / "surface.npy"
    law = folder / "joint"
    random = np.random.default_rng(0)
    np.save(surface, generate("diamond-square", nodes, hurst, SIGMA0, random))
    command = [
        "law",
        str(surface),
        "--side",
        f"{SIDE:g}",
        "--pressure",
        PRESSURES,
        *STEEL,
    ]
    if hardness is not None:
        command += ["--hardness", f"{hardness:g}"]
    command += ["-o", str(law)]
    with redirect_stdout(StringIO()):
        code = gen(command)
    if code:
        raise InputError(f"{law}: gen law failed with code {code}")
    _, table = read_table(law.with_suffix(".csv"))
    rows = [row for row in table if row["against"] == "pressure_MPa"]
    return [{name: float(row[name]) for name in LAW} for row in rows[1:-1]]
