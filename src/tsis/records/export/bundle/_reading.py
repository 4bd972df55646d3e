"""Reading a bundle: each file is checked by its hash, and the parts must belong together."""

from __future__ import annotations

import hashlib
import struct
import zlib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.calibration.file import calibration_sha256, parse_calibration
from tsis.errors import CalibrationError, FileInputError, InputError
from tsis.files import LARGEST_PIXELS, SHA256, decode_grey_png, from_json_value, png_fault
from tsis.records._estimate_json import estimate_from_json
from tsis.records._target_record import TargetRecord
from tsis.records._values import StoredPress, Target
from tsis.records.export.bundle._layout import (
    CALIBRATIONS,
    DOCUMENTS,
    ESTIMATES,
    FORMAT,
    FRAMES,
    MANIFEST,
    PRESSES,
    SAMPLES,
    TARGET,
    VERSION,
    calibration_name,
    frame_name,
    parse,
    parse_sealed,
    require_bounded,
    samples_name,
)
from tsis.records.export.bundle._sources import bundle_source
from tsis.records.store import samples_of

if TYPE_CHECKING:
    import os
    from collections.abc import Container, Iterator, Sequence

    from numpy.typing import NDArray

    from tsis.calibration.file import ProbeCalibration
    from tsis.records._values import StoredEstimate
    from tsis.records.export.bundle._sources import BundleSource


SIGNATURE = b"\x89PNG\r\n\x1a\n"
PIECE = 2**20  # bytes that are unpacked at once


def read_picture(content: bytes, name: str, rows: int, columns: int) -> NDArray[Any]:
    """Grey levels of a PNG file, shape (rows, columns), uint8 or uint16, read-only; errors call it ``name``.

    `FileInputError` when it is no whole grey PNG file of 8 or 16 bits, has another size, is too large, or has other
    content.
    """
    if rows * columns > LARGEST_PIXELS:
        raise FileInputError(f"{name} must hold at most {LARGEST_PIXELS} pixels; its press says {rows} x {columns}")
    dtype = _require_header(content, name, rows, columns)
    if (broken := png_fault(content)) is None:
        broken = _data_fault(content, rows * (1 + columns * np.dtype(dtype).itemsize))
    if broken is not None:
        raise FileInputError(f"{name} must be a complete PNG file, but {broken}")
    levels = decode_grey_png(content)
    if levels is None or levels.shape != (rows, columns) or levels.dtype != dtype:
        raise FileInputError(f"{name} must be a readable PNG file of {rows} x {columns} grey levels; it is not")
    levels.flags.writeable = False
    return levels


def _require_header(content: bytes, name: str, rows: int, columns: int) -> type:
    if content[:8] != SIGNATURE or content[12:16] != b"IHDR" or len(content) < 33:
        raise FileInputError(f"{name} must be a PNG file; got something else")
    width, height, bits, colour, packing, filtering, interlaced = struct.unpack_from(">IIBBBBB", content, 16)
    if (height, width) != (rows, columns):
        raise FileInputError(f"{name} must be {rows} x {columns} pixels, as its press says; got {height} x {width}")
    if bits not in (8, 16) or (colour, packing, filtering, interlaced) != (0, 0, 0, 0):
        raise FileInputError(f"{name} must hold 8 or 16 bits of grey, not interlaced; got another kind of PNG")
    return np.uint8 if bits == 8 else np.uint16


def _data_fault(content: bytes, size: int) -> str | None:
    """The fault in the chunks of an image of ``size`` bytes, or None.

    Compressed texts and profiles, which can unpack to any size, are refused.
    """
    unpacker, unpacked, position = zlib.decompressobj(), 0, len(SIGNATURE)
    while position < len(content):
        (length,) = struct.unpack_from(">I", content, position)
        kind = content[position + 4 : position + 8]
        if kind == b"IDAT":
            data = content[position + 8 : position + 8 + length]
            try:
                unpacked += _unpacked_bytes(unpacker, data, size + 1 - unpacked)
            except zlib.error as error:
                return f"its data cannot be unpacked: {error}"
        elif kind not in (b"IHDR", b"IEND"):
            return f"it holds a chunk {kind.decode('latin-1')!r} that is no part of a picture"
        position += 12 + length
        if kind == b"IEND":
            break
    if position != len(content) or unpacker.unused_data:
        return "it goes on after its end"
    return None if unpacked == size and unpacker.eof else f"its data do not unpack to {size} bytes"


def _unpacked_bytes(unpacker: Any, data: bytes, most: int) -> int:
    """Unpacked size of ``data``, counted in pieces; the count stops soon after ``most``."""
    unpacked, piece = 0, PIECE
    while unpacked < most and (data or piece == PIECE):  # after a full piece more may follow without more data
        piece = len(unpacker.decompress(data, PIECE))
        data = unpacker.unconsumed_tail
        unpacked += piece
    return unpacked


def require_presses(target: Target, presses: Sequence[StoredPress]) -> None:
    """Raise `InputError` for a press of another target, or presses that disagree about the size of their frame."""
    _require_different([press.id for press in presses], "press")
    sizes: dict[str, tuple[int, int]] = {}
    for number, press in enumerate(presses, start=1):
        where = f"press {number}"
        _require_own(target, press.target, where)
        if sizes.setdefault(press.frame, (press.rows, press.columns)) != (press.rows, press.columns):
            raise InputError(f"{where} must be of the size of its frame, {sizes[press.frame]}; another press says so")


def require_estimates(target: Target, presses: Sequence[StoredPress], estimates: Sequence[StoredEstimate]) -> None:
    """Raise `InputError` for an estimate of another target, or one from presses that are missing."""
    _require_different([stored.id for stored in estimates], "estimate")
    given = {press.id for press in presses}
    for number, stored in enumerate(estimates, start=1):
        _require_own(target, stored.target, f"estimate {number}")
        if missing := [press for press in stored.presses if press not in given]:
            raise InputError(f"estimate {number} must rest on presses of the bundle; got {missing[0]!r:.80}")


def require_calibrations(
    presses: Sequence[StoredPress], estimates: Sequence[StoredEstimate], calibrations: Container[str]
) -> None:
    """Raise `InputError` for a calibration that is cited but missing."""
    cited = [press.calibration for press in presses] + [stored.calibration for stored in estimates]
    for item in cited:
        if item and item not in calibrations:
            raise InputError(f"every calibration that is cited must be in the bundle; {item!r:.80} is not")


def _require_different(identities: list[str], what: str) -> None:
    stored = [identity for identity in identities if identity]  # a value outside a store has none
    if len(set(stored)) != len(stored):
        raise InputError(f"every {what} must have an identity of its own; got one twice")


def _require_own(target: Target, cited: str, where: str) -> None:
    if cited and target.id and cited != target.id:
        raise InputError(f"{where} must be of the target {target.id!r:.80}; got {cited!r:.80}")


def read_bundle(path: str | os.PathLike[str]) -> TargetRecord:
    """Read a folder or zip file that `write_bundle` wrote, on this machine or another.

    Every file is checked and each frame decoded once. A frame is read and checked again when it is used.

    Raises
    ------
    FileInputError
        When a file is missing, unknown, too large, changed by a single byte, or has invalid content; the message names
        the file.
    """
    return read_source(bundle_source(path))


def read_source(bundle_source: BundleSource) -> TargetRecord:
    """Read a bundle from any source of files: see `read_bundle`."""
    bundle = _Bundle(bundle_source)
    with _naming(TARGET):
        target = from_json_value(Target, bundle.document(TARGET), "target", complete=True)
    presses = _presses(bundle)
    estimates = _estimates(bundle)
    with _naming(PRESSES):
        require_presses(target, presses)
    with _naming(ESTIMATES):
        require_estimates(target, presses, estimates)
    calibrations = _calibrations(bundle)
    with _naming(CALIBRATIONS):
        require_calibrations(presses, estimates, calibrations)
    sizes = {press.frame: (press.rows, press.columns) for press in presses}
    bundle.require_names(FRAMES, {frame_name(frame) for frame in sizes})

    def levels(frame: str) -> NDArray[Any]:
        return read_picture(bundle.content(frame_name(frame)), frame_name(frame), *sizes[frame])

    for frame in sizes:
        levels(frame)
    return TargetRecord(target=target, presses=presses, estimates=estimates, calibrations=calibrations, read=levels)


class _Bundle:
    """A source of files with the entries of its manifest."""

    def __init__(self, bundle_source: BundleSource) -> None:
        self.path = bundle_source
        sizes = bundle_source.sizes()
        require_bounded(sizes)
        for name in (MANIFEST, *DOCUMENTS):
            if name not in sizes:
                raise FileInputError(f"{name} must be in the bundle; it is missing")
        manifest = parse_sealed(bundle_source.read(MANIFEST, sizes[MANIFEST]), MANIFEST)
        self.files = _entries(manifest)
        for name in sorted(set(sizes) ^ {*self.files, MANIFEST}):
            raise FileInputError(f"{name!r:.120} must be both in the bundle and in its manifest; it is in one of them")
        for name, (_, size) in self.files.items():
            if sizes[name] != size:
                raise FileInputError(f"{name} must hold {size} bytes, as the manifest says; got {sizes[name]}")

    def content(self, name: str) -> bytes:
        """Content of a file, checked against the manifest."""
        sha256, size = self.files[name]
        content = self.path.read(name, size)
        if len(content) != size or hashlib.sha256(content).hexdigest() != sha256:
            raise FileInputError(f"{name} must be as it was written; its SHA-256 differs from that in the manifest")
        return content

    def document(self, name: str) -> Any:
        """JSON values of a file."""
        return parse(self.content(name), name)

    def items(self, name: str) -> list[Any]:
        """The JSON list in a file."""
        result = self.document(name)
        if not isinstance(result, list):
            raise FileInputError(f"{name} must hold a JSON list; got a {type(result).__name__}")
        return result

    def require_names(self, folder: str, requested: set[str]) -> None:
        """Refuse files that nothing cites and cited files that are missing."""
        for name in sorted(requested ^ {name for name in self.files if name.startswith(f"{folder}/")}):
            what = "it is missing" if name in requested else "nothing cites it"
            raise FileInputError(f"{name} must be in the bundle and cited by it; {what}")


def _entries(manifest: dict[str, Any]) -> dict[str, tuple[str, int]]:
    if (manifest.get("format"), manifest.get("version")) != (FORMAT, VERSION):
        got = f"{manifest.get('format')!r:.60} {manifest.get('version')!r:.20}"
        raise FileInputError(f"{MANIFEST} must be of {FORMAT} {VERSION}; got {got}")
    files = manifest.get("files")
    sound = isinstance(files, dict) and all(
        isinstance(entry, dict)
        and set(entry) == {"sha256", "bytes"}
        and isinstance(entry["sha256"], str)
        and SHA256.fullmatch(entry["sha256"])
        and type(entry["bytes"]) is int
        for entry in files.values()
    )
    if not sound or files is None:
        raise FileInputError(f"{MANIFEST} must give the SHA-256 and the bytes of every file; it does not")
    return {name: (entry["sha256"], entry["bytes"]) for name, entry in files.items()}


def _presses(bundle: _Bundle) -> tuple[StoredPress, ...]:
    document = bundle.items(PRESSES)
    with _naming(PRESSES):
        return tuple(
            from_json_value(StoredPress, item, f"press {at + 1}", complete=True) for at, item in enumerate(document)
        )


def _estimates(bundle: _Bundle) -> tuple[StoredEstimate, ...]:
    document = bundle.items(ESTIMATES)
    bundle.require_names(SAMPLES, {samples_name(at) for at in range(len(document))})
    results = []
    for at, item in enumerate(document):
        samples = samples_of(bundle.content(samples_name(at)), samples_name(at))
        with _naming(ESTIMATES):
            results.append(estimate_from_json(item, samples, f"estimate {at + 1}"))
    return tuple(results)


def _calibrations(bundle: _Bundle) -> dict[str, ProbeCalibration]:
    results = {}
    for name in sorted(name for name in bundle.files if name.startswith(f"{CALIBRATIONS}/")):
        with _naming(name):
            calibration = parse_calibration(bundle.content(name), name)
        cited = calibration_sha256(calibration)
        if calibration_name(cited) != name:
            raise FileInputError(f"{name} must be named after what it holds; it holds calibration {cited}")
        results[cited] = calibration
    return results


@contextmanager
def _naming(name: str) -> Iterator[None]:
    """Add the name of the file to an error that a value of it raises."""
    try:
        yield
    except FileInputError as error:
        if name in str(error):
            raise
        raise FileInputError(f"{name}: {error}") from error
    except (InputError, CalibrationError) as error:
        raise FileInputError(f"{name}: {error}") from error
