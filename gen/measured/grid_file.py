"""Heights in .npy files and in text; `gen.measured.text` reads the headers above text."""

from io import BytesIO
from pathlib import Path

import numpy as np

from gen.arrays import Heights
from gen.measured import text
from gen.runtime.errors import InputError
from gen.runtime.files import require_file


def read(path: Path) -> list[text.Matrix]:
    """Read the matrices of a .npy or text file; text with headers may have more than one.

    Parameters
    ----------
    path : Path
        A .npy file, or text with one row of numbers on each line. Numbers are separated by `;`,
        else by whitespace around decimal commas, else by commas, else by whitespace; `#` begins a
        comment. This includes MIRCO's topologies (.dat, a `;` after each number).

    Returns
    -------
    list of Matrix
        Matrices in the order of the file; none if it is neither .npy nor text.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    require_file(path)
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        fault = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{path}: cannot be read ({fault}); give a .npy or text file") from error
    if path.suffix.lower() == ".npy" or content.startswith(np.lib.format.MAGIC_PREFIX):
        return [text.Matrix(_from_npy(content, path))]
    decoded = text.decoded(content)
    return [] if decoded is None else text.matrices(decoded, path)


def checked(heights: Heights, path: Path) -> Heights:
    """Refuse heights that are not 2-D, 2 x 2 or more, and finite or NaN."""
    if heights.ndim != 2 or min(heights.shape) < 2:
        shape = " x ".join(str(length) for length in heights.shape) or "a single number"
        content = shape if heights.size else "no heights"
        raise InputError(f"{path}: holds {content}; give 2-D heights, 2 x 2 or more")
    refused = int(np.count_nonzero(np.isinf(heights)))
    if refused:
        raise InputError(
            f"{path}: {refused} of {heights.size} heights are infinite; give finite heights"
        )
    return heights


def _from_npy(content: bytes, path: Path) -> Heights:
    """Read real numbers of any shape from the bytes of a .npy file; never unpickle objects."""
    try:
        with np.errstate(all="ignore"):  # of the numbers of nodes in a broken header
            array = np.lib.format.read_array(BytesIO(content), allow_pickle=False)
    except Exception as error:  # a broken header makes numpy raise nearly anything
        fault = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: not a whole .npy file ({fault}); save real numbers") from error
    if array.dtype.kind not in "iuf":
        raise InputError(f"{path}: holds {array.dtype} values; save real numbers (float64)")
    with np.errstate(over="ignore"):  # wider floats become infinite, and `checked` counts them
        return np.asarray(array, dtype=np.float64, order="C")
