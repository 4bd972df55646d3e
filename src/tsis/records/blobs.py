"""Immutable files named by the hash of their content: frames, calibrations, samples."""

from __future__ import annotations

import hashlib
import json
import os
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import FileInputError, InputError, RecordsError
from tsis.files.atomic import DISK, Disk, write_durably
from tsis.files.canonical_json import SHA256
from tsis.files.images import QUICK_PNG, decode_grey_png, encode_picture, image_fault
from tsis.files.reading import printable_path, read_bytes
from tsis.instrument.image_files import whole_levels

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage


ENDINGS = ("png", "json", "samples")
SAVED_AGAIN_S = 3600.0  # longer than any transaction between a file and its row


class Blobs:
    """A folder of files named by the SHA-256 of their content.

    The folder is never created here: the store may have been moved. ``allowed`` is called before each write, and raises
    where writing is not allowed.
    """

    def __init__(self, folder: Path, *, disk: Disk = DISK, allowed: Callable[[], None] = lambda: None) -> None:
        self.folder = folder
        self._disk, self._allowed = disk, allowed
        self._lasting: set[str] = set()  # folders whose names this program has synced

    def put(self, content: bytes, ending: str) -> str:
        """Save ``content`` durably and return its name.

        A whole file is not replaced, because that could lose it; it is synced again, because its writer may have been
        killed before the sync.

        `RecordsError` when it cannot be written durably; no partial file remains.
        """
        name = hashlib.sha256(content).hexdigest()
        path = self.path(name, ending)
        self._allowed()
        try:
            self._make_folder(path)
            if not self._has_content(path, content):
                self._write(path, content)
        except OSError as error:
            raise RecordsError(
                f"a file of {len(content)} bytes must be written into {printable_path(self.folder)}; got: "
                f"{error.strerror or error} (what was stored before is as it was; "
                "free some space, or have the store where it can be written)"
            ) from error
        return name

    def _make_folder(self, path: Path) -> None:
        folder = path.parent
        if folder.name not in self._lasting or not folder.is_dir():
            self._disk.make_folder(folder, private=True)
            self._disk.sync_folder(self.folder)  # also for an old folder: its creator may have been killed
            self._lasting.add(folder.name)

    def _has_content(self, path: Path, content: bytes) -> bool:
        """Whether the file is whole; it is then synced."""
        try:
            if not path.exists() or read_bytes(path) != content:
                return False
        except FileInputError:
            return False
        with suppress(OSError):
            os.utime(path)  # `remove` leaves it to the row that cites it next
        self._disk.sync_again(path)
        self._disk.sync_folder(path.parent)
        return True

    def _write(self, path: Path, content: bytes) -> None:
        damaged = path.exists()
        try:
            write_durably(path, content, disk=self._disk, drafts=self.folder, replace=damaged, private=True)
        except FileExistsError:
            if not self._has_content(path, content):  # another program wrote it meanwhile
                raise

    def get(self, name: str, ending: str) -> bytes:
        """The verified content of a file; `RecordsError` when it is missing or damaged."""
        path = self.path(name, ending)
        try:
            content = read_bytes(path)
        except FileInputError as error:
            state = "be readable" if path.exists() else "be there, and is missing"
            raise RecordsError(f"a stored file must {state}; {error}") from error
        if hashlib.sha256(content).hexdigest() != name:
            raise RecordsError(
                f"{printable_path(path)} must be as it was stored; its content does not match its name, so it was "
                "changed or damaged (take it from a backup)"
            )
        return content

    def remove(self, name: str, ending: str) -> None:
        """Remove a file that no row cites any more; one that was just saved again, by any program, stays."""
        path = self.path(name, ending)
        self._allowed()
        with suppress(OSError):
            if time.time() - path.stat().st_mtime > SAVED_AGAIN_S:
                self._disk.remove(path)

    def path(self, name: str, ending: str) -> Path:
        """Path of a file; names are hashes, so none leads out of the folder."""
        if not SHA256.fullmatch(name) or ending not in ENDINGS:
            raise RecordsError(f"a stored file must be named by a SHA-256 and end in {ENDINGS}; got {name!r:.80}")
        return self.folder / name[:2] / f"{name}.{ending}"

    def names(self) -> Iterator[tuple[str, str]]:
        """Name and ending of every file."""
        for path in sorted(self.folder.glob("[0-9a-f][0-9a-f]/*")):
            name, _, ending = path.name.partition(".")
            if SHA256.fullmatch(name) and ending in ENDINGS:
                yield name, ending


def frame_bytes(image: TactileImage) -> bytes:
    """The PNG file of a frame; `InputError` when its levels are not whole numbers in [0, full_scale]."""
    return encode_picture(whole_levels(image.grey, image.full_scale), level=QUICK_PNG)


def frame_levels(content: bytes, name: str) -> NDArray[Any]:
    """Grey levels of a verified file, shape (rows, columns), uint8 or uint16, read-only.

    `RecordsError` when the content is no grey image file.
    """
    levels = decode_grey_png(content) if image_fault(content) is None else None
    if levels is None:
        raise RecordsError(f"frame {name[:12]} must be a grey PNG file; it is not (tsis records verify)")
    levels.flags.writeable = False
    return levels


FORMAT = b"tsis-samples 1\n"
MOST_PARAMETERS, MOST_SAMPLES, LONGEST_NAME = 64, 16_000_000, 200  # samples: of all parameters together
_DIGEST = len(FORMAT) + 65
_DOUBLE = np.dtype("<f8")


def samples_bytes(estimate: Estimate) -> bytes:
    """The samples of an estimate, parameters in their order.

    Raises
    ------
    InputError
        When there are too many, or a name is not printable on one line.

    Examples
    --------
    >>> from tsis.model.estimate import Estimate
    >>> content = samples_bytes(Estimate(samples={"depth_mm": [4.0, 5.0]}, prior_sd={"depth_mm": 2.0}))
    >>> samples_of(content)
    {'depth_mm': array([4., 5.])}
    """
    samples = estimate.untrusted.samples
    parameters = [[name, int(values.size)] for name, values in samples.items()]
    if (reason := _unsound(parameters)) is not None:
        raise InputError(f"samples must be of at most {MOST_PARAMETERS} parameters and {MOST_SAMPLES}; got {reason}")
    header = json.dumps({"parameters": parameters}, separators=(",", ":")).encode() + b"\n"
    rest = header + b"".join(np.ascontiguousarray(sample, _DOUBLE).tobytes() for sample in samples.values())
    return FORMAT + hashlib.sha256(rest).hexdigest().encode() + b"\n" + rest


def samples_of(content: bytes, source: str = "samples") -> dict[str, NDArray[np.float64]]:
    """The samples that `samples_bytes` wrote; ``source`` names the file in errors.

    Raises
    ------
    FileInputError
        When it is no such file, or any byte was changed.
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
    length = end + 1 + _DOUBLE.itemsize * sum(size for _, size in parameters)
    if len(content) != length:
        raise FileInputError(f"{source} must be {length} bytes long; got {len(content)}")
    return _parts(content, parameters, end + 1, source)


def _parts(content: bytes, parameters: list[Any], start: int, source: str) -> dict[str, NDArray[np.float64]]:
    samples: dict[str, NDArray[np.float64]] = {}
    for name, size in parameters:
        samples[name] = np.frombuffer(content, _DOUBLE, count=size, offset=start).astype(np.float64)
        start += size * _DOUBLE.itemsize
        if not np.isfinite(samples[name]).all():
            raise FileInputError(f"{source} must hold finite samples; got others of {name!r}")
    return samples


def _unsound(parameters: Any) -> str | None:
    """The fault in names and lengths, or None."""
    if not isinstance(parameters, list) or len(parameters) > MOST_PARAMETERS:
        return "no list of parameters, or a long one"
    for parameter in parameters:
        if (
            not isinstance(parameter, list)
            or len(parameter) != 2
            or not isinstance(parameter[0], str)
            or type(parameter[1]) is not int
        ):
            return f"{parameter!r:.80} for a name and a length"
        if not 0 < len(parameter[0]) <= LONGEST_NAME or not parameter[0].isprintable():
            return f"the name {parameter[0]!r:.80}"
        if not 0 < parameter[1] <= MOST_SAMPLES:
            return f"{parameter[1]!r:.20} of {parameter[0]!r:.80}"
    names = {parameter[0] for parameter in parameters}
    if len(names) != len(parameters) or sum(parameter[1] for parameter in parameters) > MOST_SAMPLES:
        return "a name twice, or too many in all"
    return None
