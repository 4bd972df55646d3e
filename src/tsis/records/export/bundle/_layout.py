"""Names, sizes and JSON form of the files of a bundle."""

from __future__ import annotations

import hashlib
import json
import re
from typing import TYPE_CHECKING, Any, NoReturn

from tsis.errors import FileInputError
from tsis.files import json_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping


FORMAT, VERSION = "tsis-bundle", 1
MANIFEST, TARGET, PRESSES, ESTIMATES = "manifest.json", "target.json", "presses.json", "estimates.json"
DOCUMENTS = (TARGET, PRESSES, ESTIMATES)
FRAMES, CALIBRATIONS, SAMPLES = "frames", "calibrations", "samples"
FOLDERS = (FRAMES, CALIBRATIONS, SAMPLES)

MIB = 2**20
MOST_FILES = 20_000
MOST_BYTES = 16 * 1024 * MIB
MOST_SAMPLE_BYTES = 32 * MIB  # of all estimates together, which are in memory at once
# Longest file of each kind, by the pattern of its name.
LARGEST = {
    re.compile(r"(manifest|target|presses|estimates)\.json"): 16 * MIB,
    re.compile(r"frames/[0-9a-f]{64}\.png"): 256 * MIB,  # 65 million incompressible pixels of 16 bits
    re.compile(r"calibrations/[0-9a-f]{64}\.json"): 128 * MIB,
    re.compile(r"samples/[0-9]{5}\.samples"): MOST_SAMPLE_BYTES,
}


def frame_name(sha256: str) -> str:
    """Name of the file of a frame."""
    return f"{FRAMES}/{sha256}.png"


def calibration_name(sha256: str) -> str:
    """Name of the file of a calibration."""
    return f"{CALIBRATIONS}/{sha256}.json"


def samples_name(number: int) -> str:
    """Name of the file of an estimate's samples."""
    return f"{SAMPLES}/{number:05d}.samples"


def largest(name: str) -> int:
    """Largest size of a file of this name in bytes; 0 for a name that a bundle does not allow.

    Examples
    --------
    >>> largest("target.json"), largest("../target.json")
    (16777216, 0)
    """
    return next((most for pattern, most in LARGEST.items() if pattern.fullmatch(name)), 0)


def require_bounded(sizes: Mapping[str, int]) -> None:
    """Raise `FileInputError` for invalid names and sizes before anything is read."""
    if len(sizes) > MOST_FILES:
        raise FileInputError(f"a bundle must hold at most {MOST_FILES} files; got more")
    for name, size in sizes.items():
        most = largest(name)
        if not most:
            raise FileInputError(f"{name!r:.120} must not be in a bundle; it is no file of one")
        if not 0 < size <= most:
            raise FileInputError(f"{name} must hold 1 to {most} bytes; got {size}")
    if (total := sum(sizes.values())) > MOST_BYTES:
        raise FileInputError(f"a bundle must hold at most {MOST_BYTES} bytes; got {total}")
    samples = sum(size for name, size in sizes.items() if name.startswith(SAMPLES))
    if samples > MOST_SAMPLE_BYTES:
        raise FileInputError(f"{SAMPLES} must hold at most {MOST_SAMPLE_BYTES} bytes together; got {samples}")


MOST_VALUES = 500_000  # a byte of JSON can become forty of memory
SEALED = "sha256"


def document_bytes(content: Any) -> bytes:
    """The JSON form of values in a bundle."""
    return json_bytes(content, indent=1)


def sealed_bytes(content: dict[str, Any]) -> bytes:
    """The JSON form with the SHA-256 of the other content."""
    seal = hashlib.sha256(document_bytes(content)).hexdigest()
    return document_bytes(content | {SEALED: seal})


def parse(content: bytes, name: str) -> Any:
    """The JSON values of the file ``name``.

    `FileInputError` when it is no JSON, has a duplicate name or an invalid number, is nested too deeply or has too many
    values.
    """
    values = sum(content.count(sign) for sign in (b",", b"[", b"{"))
    if values > MOST_VALUES:
        raise FileInputError(f"{name} must hold at most {MOST_VALUES} values; got {values}")
    try:
        return json.loads(content.decode(), object_pairs_hook=_unique_keys, parse_constant=_refuse_number)
    except (ValueError, RecursionError) as error:
        raise FileInputError(f"{name} must be a readable JSON file; got: {str(error)[:200]}") from error


def parse_sealed(content: bytes, name: str) -> dict[str, Any]:
    """The JSON values of a file that `sealed_bytes` wrote; errors as `parse`, and when any byte was changed."""
    result = parse(content, name)
    if not isinstance(result, dict):
        raise FileInputError(f"{name} must hold a JSON object; got a {type(result).__name__}")
    try:
        requested = sealed_bytes({key: value for key, value in result.items() if key != SEALED})
    except (ValueError, RecursionError) as error:
        raise FileInputError(f"{name} must be as it was written; got: {str(error)[:200]}") from error
    if requested != content:
        raise FileInputError(f"{name} must be as it was written; it does not match its own hash, so it was changed")
    return result


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        raise ValueError("a name twice in one object")
    return result


def _refuse_number(term: str) -> NoReturn:
    raise ValueError(f"{term}, which is no number of JSON")
