"""Posterior samples as bytes: exact, hashed, and nothing is unpacked before its size is known.

A line that names the format, the SHA-256 of what follows as 64 hexadecimal digits and a line end, one line of JSON with
the names and lengths of the parameters, and their samples one after another as little-endian doubles.
"""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.model.errors import FileInputError, InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import Estimate

FORMAT = b"tsis-samples 1\n"
MOST_PARAMETERS, MOST_SAMPLES, LONGEST_NAME = 64, 16_000_000, 200  # samples: of all parameters together
_DIGEST = len(FORMAT) + 65
_DOUBLE = np.dtype("<f8")


def samples_bytes(estimate: Estimate) -> bytes:
    """The samples of an estimate, parameters in their order.

    Raises
    ------
    InputError
        When they are too many, or a name cannot be shown on one line.

    Examples
    --------
    >>> from tsis.model import Estimate
    >>> content = samples_bytes(Estimate(samples={"depth_mm": [4.0, 5.0]}, prior_sd={"depth_mm": 2.0}))
    >>> samples_of(content)
    {'depth_mm': array([4., 5.])}
    """
    parameters = [[name, int(values.size)] for name, values in estimate.samples.items()]
    if (reason := _unsound(parameters)) is not None:
        raise InputError(f"samples must be of at most {MOST_PARAMETERS} parameters and {MOST_SAMPLES}; got {reason}")
    header = json.dumps({"parameters": parameters}, separators=(",", ":")).encode() + b"\n"
    rest = header + b"".join(np.ascontiguousarray(each, _DOUBLE).tobytes() for each in estimate.samples.values())
    return FORMAT + hashlib.sha256(rest).hexdigest().encode() + b"\n" + rest


def samples_of(content: bytes, source: str = "samples") -> dict[str, NDArray[np.float64]]:
    """The samples that `samples_bytes` wrote; ``source`` names the file in errors.

    Raises
    ------
    FileInputError
        When it is no such file, or a single byte of it was changed.
    """
    if content[: len(FORMAT)] != FORMAT:
        raise FileInputError(f"{source} must begin with {FORMAT!r}; got {content[: len(FORMAT)]!r}")
    if hashlib.sha256(content[_DIGEST:]).hexdigest().encode() + b"\n" != content[len(FORMAT) : _DIGEST]:
        raise FileInputError(f"{source} must be as it was written; its content does not match its hash")
    end = content.find(b"\n", _DIGEST, _DIGEST + MOST_PARAMETERS * (8 * LONGEST_NAME))
    try:
        parameters = json.loads(content[_DIGEST:end])["parameters"]
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise FileInputError(f"{source} must name its parameters in its header; got something else") from error
    if (reason := _unsound(parameters)) is not None:
        raise FileInputError(f"{source} must hold a sensible number of samples; got {reason}")
    wanted = end + 1 + _DOUBLE.itemsize * sum(size for _, size in parameters)
    if len(content) != wanted:
        raise FileInputError(f"{source} must be {wanted} bytes long; got {len(content)}")
    return _parts(content, parameters, end + 1, source)


def _parts(content: bytes, parameters: list[Any], start: int, source: str) -> dict[str, NDArray[np.float64]]:
    found: dict[str, NDArray[np.float64]] = {}
    for name, size in parameters:
        found[name] = np.frombuffer(content, _DOUBLE, count=size, offset=start).astype(np.float64)
        start += size * _DOUBLE.itemsize
        if not np.isfinite(found[name]).all():
            raise FileInputError(f"{source} must hold finite samples; got others of {name!r}")
    return found


def _unsound(parameters: Any) -> str | None:
    """What is wrong with names and lengths; None when nothing is."""
    if not isinstance(parameters, list) or len(parameters) > MOST_PARAMETERS:
        return "no list of parameters, or a long one"
    for each in parameters:
        if not isinstance(each, list) or len(each) != 2 or not isinstance(each[0], str) or type(each[1]) is not int:
            return f"{each!r:.80} for a name and a length"
        if not 0 < len(each[0]) <= LONGEST_NAME or not each[0].isprintable():
            return f"the name {each[0]!r:.80}"
        if not 0 < each[1] <= MOST_SAMPLES:
            return f"{each[1]!r:.20} of {each[0]!r:.80}"
    names = {each[0] for each in parameters}
    if len(names) != len(parameters) or sum(each[1] for each in parameters) > MOST_SAMPLES:
        return "a name twice, or too many in all"
    return None
