"""Whether the parts of a bundle belong together."""

from __future__ import annotations

import hashlib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from tsis.calibration.file import calibration_sha256, parse_calibration
from tsis.errors import CalibrationError, FileInputError, InputError
from tsis.files import SHA256
from tsis.records._plain import estimate_of_plain, press_of_plain, target_of_plain
from tsis.records._target_record import TargetRecord
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
from tsis.records.export.bundle._picture import read_picture
from tsis.records.export.bundle._sources import bundle_source
from tsis.records.store import samples_of

if TYPE_CHECKING:
    import os
    from collections.abc import Container, Iterator, Sequence

    from numpy.typing import NDArray

    from tsis.calibration.file import ProbeCalibration
    from tsis.records._values import StoredEstimate, StoredPress, Target
    from tsis.records.export.bundle._sources import BundleSource


def require_presses(target: Target, presses: Sequence[StoredPress]) -> None:
    """Refuse presses of another target, or that disagree about a frame that they share.

    Raises
    ------
    InputError
        Saying which press, and why.
    """
    _require_different([press.id for press in presses], "press")
    sizes: dict[str, tuple[int, int]] = {}
    for number, press in enumerate(presses, start=1):
        where = f"press {number}"
        _require_own(target, press.target, where)
        if sizes.setdefault(press.frame, (press.rows, press.columns)) != (press.rows, press.columns):
            raise InputError(f"{where} must be of the size of its frame, {sizes[press.frame]}; another press says so")


def require_estimates(target: Target, presses: Sequence[StoredPress], estimates: Sequence[StoredEstimate]) -> None:
    """Refuse estimates of another target, or from presses that are not there.

    Raises
    ------
    InputError
        Saying which estimate, and why.
    """
    _require_different([stored.id for stored in estimates], "estimate")
    given = {press.id for press in presses}
    for number, stored in enumerate(estimates, start=1):
        _require_own(target, stored.target, f"estimate {number}")
        if missing := [press for press in stored.presses if press not in given]:
            raise InputError(f"estimate {number} must rest on presses of the bundle; got {missing[0]!r:.80}")


def require_calibrations(
    presses: Sequence[StoredPress], estimates: Sequence[StoredEstimate], calibrations: Container[str]
) -> None:
    """Refuse a bundle that lacks a calibration which it cites.

    Raises
    ------
    InputError
        Saying which.
    """
    cited = [press.calibration for press in presses] + [stored.calibration for stored in estimates]
    for item in cited:
        if item and item not in calibrations:
            raise InputError(f"every calibration that is cited must be in the bundle; {item!r:.80} is not")


def _require_different(identities: list[str], what: str) -> None:
    stored = [identity for identity in identities if identity]  # what was never stored has none
    if len(set(stored)) != len(stored):
        raise InputError(f"every {what} must have an identity of its own; got one twice")


def _require_own(target: Target, cited: str, where: str) -> None:
    if cited and target.id and cited != target.id:
        raise InputError(f"{where} must be of the target {target.id!r:.80}; got {cited!r:.80}")


def read_bundle(path: str | os.PathLike[str]) -> TargetRecord:
    """Read a folder or zip file that `write_bundle` wrote, wherever it comes from.

    Every file is checked, each frame unpacked once; frames are read again, and checked again, when they are asked for.

    Raises
    ------
    FileInputError
        When a file is missing, unknown, too large, changed by a single byte, or holds what no dossier holds; the
        message names the file.
    """
    return read_source(bundle_source(path))


def read_source(bundle_source: BundleSource) -> TargetRecord:
    """The same from wherever the files are listed and read: see `read_bundle`."""
    bundle = _Bundle(bundle_source)
    with _naming(TARGET):
        target = target_of_plain(bundle.document(TARGET))
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
    """A place, and what its manifest says of each file."""

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
        """Content of a file, found as the manifest says."""
        sha256, size = self.files[name]
        content = self.path.read(name, size)
        if len(content) != size or hashlib.sha256(content).hexdigest() != sha256:
            raise FileInputError(f"{name} must be as it was written; its SHA-256 differs from that in the manifest")
        return content

    def document(self, name: str) -> Any:
        """Plain values of a file."""
        return parse(self.content(name), name)

    def items(self, name: str) -> list[Any]:
        """The list of plain values that a file holds."""
        result = self.document(name)
        if not isinstance(result, list):
            raise FileInputError(f"{name} must hold a JSON list; got a {type(result).__name__}")
        return result

    def require_names(self, folder: str, requested: set[str]) -> None:
        """Refuse files in a folder that nothing cites, and cited ones that are missing."""
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
        return tuple(press_of_plain(item, f"press {at + 1}") for at, item in enumerate(document))


def _estimates(bundle: _Bundle) -> tuple[StoredEstimate, ...]:
    document = bundle.items(ESTIMATES)
    bundle.require_names(SAMPLES, {samples_name(at) for at in range(len(document))})
    results = []
    for at, item in enumerate(document):
        samples = samples_of(bundle.content(samples_name(at)), samples_name(at))
        with _naming(ESTIMATES):
            results.append(estimate_of_plain(item, samples, f"estimate {at + 1}"))
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
    """Say in which file a value was that its own class refuses."""
    try:
        yield
    except FileInputError as error:
        if name in str(error):
            raise
        raise FileInputError(f"{name}: {error}") from error
    except (InputError, CalibrationError) as error:
        raise FileInputError(f"{name}: {error}") from error
