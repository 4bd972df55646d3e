"""The form of a target on disk, with the SHA-256 of every file."""

from __future__ import annotations

import hashlib
import json
import os
import re
import stat
import struct
import zipfile
import zlib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn, Protocol

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.calibration.file import calibration_bytes, calibration_sha256, parse_calibration
from tsis.errors import CalibrationError, FileInputError, InputError, RecordsError
from tsis.files.canonical_json import SHA256, json_bytes
from tsis.files.images import LARGEST_PIXELS, decode_grey_png, png_fault
from tsis.files.json_values import from_json_value, to_json_value
from tsis.files.reading import as_path, file_error, file_size, printable_path
from tsis.records.blobs import samples_bytes, samples_of
from tsis.records.export import export_file, export_folder, frame_png
from tsis.records.values import (
    StoredPress,
    Target,
    TargetRecord,
    estimate_from_json,
    estimate_to_json,
    map_bytes,
    map_from_json,
    map_to_json,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.calibration.file import ProbeCalibration
    from tsis.records.values import StoredEstimate, StoredMap

    Put = Callable[[str, bytes], object]


FORMAT, VERSION = "tsis-bundle", 1
MANIFEST, TARGET, PRESSES, ESTIMATES = "manifest.json", "target.json", "presses.json", "estimates.json"
MAPS = "maps.json"  # where there is a map
DOCUMENTS = (TARGET, PRESSES, ESTIMATES)
FRAMES, CALIBRATIONS, SAMPLES, MAP_FILES = "frames", "calibrations", "samples", "maps"
FOLDERS = (FRAMES, CALIBRATIONS, SAMPLES, MAP_FILES)

MIB = 2**20
MOST_FILES = 20_000
MOST_BYTES = 16 * 1024 * MIB
MOST_SAMPLE_BYTES = 32 * MIB  # of all estimates together, which are in memory at once
MOST_MAP_BYTES = 256 * MIB  # of all maps together, as well
# Longest file of each kind, by the pattern of its name.
LARGEST = {
    re.compile(r"(manifest|target|presses|estimates|maps)\.json"): 16 * MIB,
    re.compile(r"frames/[0-9a-f]{64}\.png"): 256 * MIB,  # 65 million incompressible pixels of 16 bits
    re.compile(r"calibrations/[0-9a-f]{64}\.json"): 128 * MIB,
    re.compile(r"samples/[0-9]{5}\.samples"): MOST_SAMPLE_BYTES,
    re.compile(r"maps/[0-9]{5}\.json"): MOST_MAP_BYTES,
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


def map_name(number: int) -> str:
    """Name of the file of a map."""
    return f"{MAP_FILES}/{number:05d}.json"


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
    for folder, most in ((SAMPLES, MOST_SAMPLE_BYTES), (MAP_FILES, MOST_MAP_BYTES)):
        together = sum(size for name, size in sizes.items() if name.startswith(f"{folder}/"))
        if together > most:
            raise FileInputError(f"{folder} must hold at most {most} bytes together; got {together}")


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
    values = parse(content, name)
    if not isinstance(values, dict):
        raise FileInputError(f"{name} must hold a JSON object; got a {type(values).__name__}")
    try:
        written = sealed_bytes({key: value for key, value in values.items() if key != SEALED})
    except (ValueError, RecursionError) as error:
        raise FileInputError(f"{name} must be as it was written; got: {str(error)[:200]}") from error
    if written != content:
        raise FileInputError(f"{name} must be as it was written; it does not match its own hash, so it was changed")
    return values


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) != len(pairs):
        raise ValueError("a name twice in one object")
    return values


def _refuse_number(number: str) -> NoReturn:
    raise ValueError(f"{number}, which is no number of JSON")


MOST_UNPACKED, FREE_BYTES = 100, 16 * MIB  # limit of the unpacked size: ratio to the zip file, and allowance
END, END_64 = b"PK\x05\x06", b"PK\x06\x07"
DIRECTORY_BYTES = 256  # of an entry in the directory of a zip file, far above the need of valid names


class BundleSource(Protocol):
    """A bundle's files by their names."""

    def sizes(self) -> dict[str, int]:
        """Declared size of every file in bytes."""

    def read(self, name: str, most: int) -> bytes:
        """Content of a file of at most ``most`` bytes."""


def bundle_source(path: str | os.PathLike[str]) -> BundleSource:
    """The folder or zip file of this name, or `FileInputError`."""
    source = as_path(path)
    if source.is_dir():
        return FolderSource(source)
    return ZipSource(source, file_size(source))


class FolderSource:
    """A folder: regular files in it and in the folders of a bundle, no links."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def sizes(self) -> dict[str, int]:
        """Size of every file in bytes."""
        sizes: dict[str, int] = {}
        with _refusing(printable_path(self.folder)):
            self._list(self.folder, "", sizes)
        return sizes

    def _list(self, folder: Path, before: str, sizes: dict[str, int]) -> None:
        with os.scandir(folder) as entries:
            for entry in entries:
                name = f"{before}{entry.name}"
                status = entry.stat(follow_symlinks=False)
                if stat.S_ISDIR(status.st_mode) and name in FOLDERS:
                    self._list(folder / entry.name, f"{name}/", sizes)
                elif stat.S_ISREG(status.st_mode):
                    sizes[name] = status.st_size
                else:
                    raise FileInputError(f"{name!r:.120} must be a file of a bundle; got a link, folder or device")
                if len(sizes) > MOST_FILES:
                    raise file_error(self.folder, f"must hold at most {MOST_FILES} files; got more")

    def read(self, name: str, most: int) -> bytes:
        """Content of a file; links are not followed."""
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        with _refusing(name), os.fdopen(os.open(self.folder / name, flags), "rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise FileInputError(f"{name} must be a regular file; got something else")
            return _bounded(file.read(most + 1), name, most)


class ZipSource:
    """A zip file: declared sizes are checked first, and again during unpacking."""

    def __init__(self, path: Path, size: int) -> None:
        self.path, self.size = path, size

    def sizes(self) -> dict[str, int]:
        """Size of every file in bytes, from the directory of the zip file."""
        with _refusing(printable_path(self.path)):
            self._require_short_directory()
            with zipfile.ZipFile(self.path) as file:
                entries = [item for item in file.infolist() if item.filename not in {f"{name}/" for name in FOLDERS}]
        sizes = {entry.filename: entry.file_size for entry in entries}
        if len(sizes) != len(entries):
            raise file_error(self.path, "must hold every name once; got one twice")
        if sum(sizes.values()) > FREE_BYTES + MOST_UNPACKED * self.size:
            raise file_error(self.path, f"must unpack to at most {MOST_UNPACKED} times its size; it declares more")
        for entry in entries:
            if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or entry.flag_bits & 1:
                raise FileInputError(f"{entry.filename!r:.120} must be stored or deflated, not encrypted; it is not")
        return sizes

    def _require_short_directory(self) -> None:
        """Check the length of the directory, which takes memory before its entries can be checked."""
        with self.path.open("rb") as file:
            file.seek(max(0, self.size - 42))
            tail = file.read(42)
        if tail[-22:-18] != END or tail[-2:] != b"\0\0" or tail[:4] == END_64:
            raise file_error(self.path, "must be a zip file of at most 4 GiB without comment; it is not")
        if int.from_bytes(tail[-10:-6], "little") > MOST_FILES * DIRECTORY_BYTES:
            raise file_error(self.path, f"must hold at most {MOST_FILES} files; its directory is longer")

    def read(self, name: str, most: int) -> bytes:
        """Content of a file; unpacking stops after ``most`` bytes."""
        with _refusing(name), zipfile.ZipFile(self.path) as file, file.open(name) as entry:
            return _bounded(entry.read(most + 1), name, most)


def _bounded(content: bytes, name: str, most: int) -> bytes:
    if len(content) > most:
        raise FileInputError(f"{name} must hold at most {most} bytes; got more")
    return content


@contextmanager
def _refusing(what: str) -> Iterator[None]:
    try:
        yield
    except FileInputError:
        raise
    except Exception as error:  # on hostile bytes the parsers raise nearly anything
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise FileInputError(f"{what} must be readable; got: {reason:.200}") from error


SIGNATURE = b"\x89PNG\r\n\x1a\n"


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
    """The fault in the chunks of an image of ``size`` bytes, of which no more are unpacked, or None."""
    unpacker, unpacked, position, kind = zlib.decompressobj(), 0, len(SIGNATURE), b""
    while kind != b"IEND":
        length, kind = struct.unpack_from(">I4s", content, position)
        end = position + 12 + length
        if kind == b"IDAT" and unpacked <= size:
            try:
                unpacked += len(unpacker.decompress(content[position + 8 : end - 4], size + 1 - unpacked))
            except zlib.error as error:
                return f"its data cannot be unpacked: {error}"
        elif kind not in (b"IHDR", b"IDAT", b"IEND"):  # compressed texts and profiles can unpack to any size
            return f"it holds a chunk {kind.decode('latin-1')!r} that is no part of a picture"
        position = end
    if position != len(content) or unpacker.unused_data:
        return "it goes on after its end"
    return None if unpacked == size and unpacker.eof else f"its data do not unpack to {size} bytes"


def require_presses(target: Target, presses: Sequence[StoredPress]) -> None:
    """Raise `InputError` for a press of another target, or presses that disagree about the size of their frame."""
    _require_different([press.id for press in presses], "press")
    sizes: dict[str, tuple[int, int]] = {}
    for number, press in enumerate(presses, start=1):
        where = f"press {number}"
        _require_own(target, press.target, where)
        if sizes.setdefault(press.frame, (press.rows, press.columns)) != (press.rows, press.columns):
            raise InputError(f"{where} must be of the size of its frame, {sizes[press.frame]}; another press says so")


def require_results(
    target: Target, presses: Sequence[StoredPress], results: Sequence[StoredEstimate | StoredMap], what: str
) -> None:
    """Raise `InputError` for a result of another target, or one from presses that are missing."""
    _require_different([stored.id for stored in results], what)
    known = {press.id for press in presses}
    for number, stored in enumerate(results, start=1):
        _require_own(target, stored.target, f"{what} {number}")
        if missing := [press for press in stored.presses if press not in known]:
            raise InputError(f"{what} {number} must rest on presses of the bundle; got {missing[0]!r:.80}")


def require_calibrations(
    presses: Sequence[StoredPress], results: Sequence[StoredEstimate | StoredMap], calibrations: Container[str]
) -> None:
    """Raise `InputError` for a calibration that is cited but missing."""
    cited = [press.calibration for press in presses] + [stored.calibration for stored in results]
    for calibration in cited:
        if calibration and calibration not in calibrations:
            raise InputError(f"every calibration that is cited must be in the bundle; {calibration!r:.80} is not")


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


def read_source(source: BundleSource) -> TargetRecord:
    """Read a bundle from any source of files: see `read_bundle`."""
    bundle = _Bundle(source)
    with _naming(TARGET):
        target = from_json_value(Target, bundle.document(TARGET), "target", complete=True)
    presses = _presses(bundle)
    estimates, maps = _estimates(bundle), _maps(bundle)
    with _naming(PRESSES):
        require_presses(target, presses)
    with _naming(ESTIMATES):
        require_results(target, presses, estimates, "estimate")
    with _naming(MAPS):
        require_results(target, presses, maps, "map")
    calibrations = _calibrations(bundle)
    with _naming(CALIBRATIONS):
        require_calibrations(presses, (*estimates, *maps), calibrations)
    sizes = {press.frame: (press.rows, press.columns) for press in presses}
    bundle.require_names(FRAMES, {frame_name(frame) for frame in sizes})

    def levels(frame: str) -> NDArray[Any]:
        return read_picture(bundle.content(frame_name(frame)), frame_name(frame), *sizes[frame])

    for frame in sizes:
        levels(frame)
    return TargetRecord(
        target=target, presses=presses, estimates=estimates, maps=maps, calibrations=calibrations, read=levels
    )


class _Bundle:
    """A source of files with the entries of its manifest."""

    def __init__(self, source: BundleSource) -> None:
        self.path = source
        sizes = source.sizes()
        require_bounded(sizes)
        for name in (MANIFEST, *DOCUMENTS):
            if name not in sizes:
                raise FileInputError(f"{name} must be in the bundle; it is missing")
        manifest = parse_sealed(source.read(MANIFEST, sizes[MANIFEST]), MANIFEST)
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
        items = self.document(name)
        if not isinstance(items, list):
            raise FileInputError(f"{name} must hold a JSON list; got a {type(items).__name__}")
        return items

    def require_names(self, folder: str, cited: set[str]) -> None:
        """Refuse files that nothing cites and cited files that are missing."""
        for name in sorted(cited ^ {name for name in self.files if name.startswith(f"{folder}/")}):
            what = "it is missing" if name in cited else "nothing cites it"
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
    items = bundle.items(PRESSES)
    with _naming(PRESSES):
        return tuple(
            from_json_value(StoredPress, item, f"press {at + 1}", complete=True) for at, item in enumerate(items)
        )


def _estimates(bundle: _Bundle) -> tuple[StoredEstimate, ...]:
    items = bundle.items(ESTIMATES)
    bundle.require_names(SAMPLES, {samples_name(at) for at in range(len(items))})
    estimates = []
    for at, item in enumerate(items):
        samples = samples_of(bundle.content(samples_name(at)), samples_name(at))
        with _naming(ESTIMATES):
            estimates.append(estimate_from_json(item, samples, f"estimate {at + 1}"))
    return tuple(estimates)


def _maps(bundle: _Bundle) -> tuple[StoredMap, ...]:
    items = bundle.items(MAPS) if MAPS in bundle.files else []
    bundle.require_names(MAP_FILES, {map_name(at) for at in range(len(items))})
    maps = []
    for at, item in enumerate(items):
        with _naming(map_name(at)):
            maps.append(map_from_json(item, bundle.content(map_name(at)), f"map {at + 1}"))
    return tuple(maps)


def _calibrations(bundle: _Bundle) -> dict[str, ProbeCalibration]:
    calibrations = {}
    for name in sorted(name for name in bundle.files if name.startswith(f"{CALIBRATIONS}/")):
        with _naming(name):
            calibration = parse_calibration(bundle.content(name), name)
        cited = calibration_sha256(calibration)
        if calibration_name(cited) != name:
            raise FileInputError(f"{name} must be named after what it holds; it holds calibration {cited}")
        calibrations[cited] = calibration
    return calibrations


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


EARLIEST = (1980, 1, 1, 0, 0, 0)  # the time of every file in a zip file, so that equal bundles have equal bytes


def write_bundle(record: TargetRecord, path: str | os.PathLike[str]) -> str:
    """Write a target record as a new folder, or as a new zip file where the name ends in ``.zip``.

    Returns
    -------
    str
        SHA-256 of the manifest. The manifest has the hash of every other file, so this hash identifies the bundle.

    Raises
    ------
    FileInputError
        When the name is taken, or the bundle cannot be written.
    RecordsError
        When the record lacks something that it cites, or the bundle cannot be read back.
    """
    destination = as_path(path)
    if destination.suffix.lower() != ".zip":
        with export_folder(destination) as draft:
            for name in FOLDERS:
                (draft / name).mkdir()
            seal = _write(record, lambda name, content: (draft / name).write_bytes(content))
            _require_readable(draft)
        return seal
    with export_file(destination) as draft:
        try:
            with zipfile.ZipFile(draft, "x", allowZip64=False) as file:
                seal = _write(record, lambda name, content: file.writestr(zipfile.ZipInfo(name, EARLIEST), content))
        except zipfile.LargeZipFile as error:
            raise file_error(destination, "must hold at most 4 GiB; got more (write a folder)", InputError) from error
        _require_readable(draft)
    return seal


def _write(record: TargetRecord, put: Put) -> str:
    entries: dict[str, dict[str, Any]] = {}
    for name, content in _files(record):
        put(name, content)
        entries[name] = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
    head = {"format": FORMAT, "version": VERSION, "notice": RESEARCH_USE_ONLY, "tsis": __version__}
    manifest = sealed_bytes(head | {"files": dict(sorted(entries.items()))})
    put(MANIFEST, manifest)
    return hashlib.sha256(manifest).hexdigest()


def _files(record: TargetRecord) -> Iterator[tuple[str, bytes]]:
    """Every file but the manifest, one at a time."""
    yield TARGET, document_bytes(to_json_value(record.target))
    yield PRESSES, document_bytes([to_json_value(press) for press in record.presses])
    yield ESTIMATES, document_bytes([estimate_to_json(stored) for stored in record.estimates])
    for number, stored in enumerate(record.estimates):
        yield samples_name(number), samples_bytes(stored.estimate)
    if record.maps:
        yield MAPS, document_bytes([map_to_json(stored) for stored in record.maps])
    for number, found in enumerate(record.maps):
        yield map_name(number), map_bytes(found.estimate)
    for cited, calibration in record.calibrations.items():
        yield calibration_name(cited), calibration_bytes(calibration)
    for frame, press in {press.frame: press for press in record.presses}.items():
        if not SHA256.fullmatch(frame):
            raise InputError(f"frame must be a SHA-256 in hexadecimal digits; got {frame!r:.80}")
        yield frame_name(frame), frame_png(record, press)


def _require_readable(draft: Path) -> None:
    try:
        read_bundle(draft)
    except InputError as error:
        raise RecordsError(f"a bundle must be one that can be read back; this one cannot: {error}") from error
