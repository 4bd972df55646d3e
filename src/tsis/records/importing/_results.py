"""Import of result folders of ``tsis demo``, and entry of new targets and estimates."""

from __future__ import annotations

from datetime import timedelta
from typing import TYPE_CHECKING, Any, TypeVar

from tsis.__about__ import CALIBRATION_FILE
from tsis.calibration.file import read_calibration
from tsis.catalog import load_probe
from tsis.errors import InputError
from tsis.files import (
    file_error,
    from_json_value,
    own_file,
    printable_path,
    read_object,
    require_known_schema,
    written_by,
)
from tsis.model import grey_sha256
from tsis.records._provenance import environment
from tsis.records.importing._batch import (
    ImportBatch,
    IncomingPress,
    RequestedEstimate,
    inspect_file,
    modification_time,
    read_frame,
)
from tsis.records.store import frame_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.model import Estimate, TactileImage
    from tsis.records._values import StoredEstimate, StoredPress, Target
    from tsis.records.store import Store


Value = TypeVar("Value")


def new_target(
    store: Store,
    first: Iterable[TactileImage],
    *,
    number: int | None = None,
    name: str = "",
    truth: Mapping[str, float] | None = None,
) -> Target:
    """Add a target after its first frames are on the disk, so that a full disk leaves no target without a press."""
    for image in first:
        store.blobs.put(frame_bytes(image), "png")
    return store.add_target(number=number, name=name, truth=truth)


def enter_estimate(
    store: Store,
    target: Target,
    estimate: Estimate,
    *,
    kind: str,
    presses: Sequence[StoredPress],
    probe: str,
    calibration: ProbeCalibration,
    options: Mapping[str, Any],
) -> StoredEstimate:
    """Store a new estimate of all presses except those of the untouched probe."""
    return store.add_estimate(
        target,
        estimate,
        kind=kind,
        presses=estimate_presses(presses),
        probe=probe,
        calibration=calibration,
        options=options,
        environment=environment(),
    )


def estimate_presses(presses: Iterable[StoredPress]) -> tuple[StoredPress, ...]:
    """The presses of an estimate."""
    return tuple(press for press in presses if press.role != "untouched")


RESULT, UNTOUCHED = "result.json", "untouched.png"
MOST_PRESSES = 1000
TRUTH = ("diameter_mm", "depth_mm", "young_kpa")


def result_folder(folder: Path, progress: Callable[[], None]) -> ImportBatch:
    """The presses in a folder of ``tsis demo``, each checked by the hash in the result.

    `FileInputError` when it is no such folder, or a frame differs; `CalibrationError` when the calibration was changed.
    """
    source = own_file(folder, RESULT)
    document = read_object(source)
    require_known_schema(document, printable_path(source))
    with written_by("tsis demo", source):
        return _batch(folder, document, progress)


def _batch(folder: Path, document: dict[str, Any], progress: Callable[[], None]) -> ImportBatch:
    command = document.get("command")
    if command != "demo":
        raise file_error(
            folder / RESULT,
            f"must be of tsis demo, whose folder holds its frames; got "
            f"one of {command!r:.40} "
            "(name the frames, or repeat the command with --save)",
        )
    reported = document["estimate"]["provenance"]
    calibration = read_calibration(own_file(folder, CALIBRATION_FILE))
    probe, phantom = from_json_value(str, reported["probe"]["name"], "probe.name"), document["simulated"]["phantom"]
    presses = list(_presses(folder, reported, calibration, probe, progress))
    inclusion = phantom.get("inclusion")
    names = () if inclusion is None else TRUTH
    truth = {name: from_json_value(float, inclusion[name], f"inclusion.{name}") for name in names}
    options = {"prior": dict(reported["prior"]), "strain": reported.get("strain", "small")}  # older demos state none
    requested = RequestedEstimate(kind="inclusion", probe=probe, calibration=calibration, options=options)
    _require_estimable(requested)
    return ImportBatch(
        source=folder,
        kind="virtual presses",
        presses=tuple(presses),
        name=from_json_value(str, phantom["name"], "phantom.name"),
        truth=truth,
        simulated=True,
        estimate=requested,
    )


def _require_estimable(estimate: RequestedEstimate) -> None:
    """Check the inputs of the estimate before anything is stored."""
    from tsis.records._estimation import require_options  # slow to import, rarely needed

    load_probe(estimate.probe)
    estimate.calibration.cited_response("")
    require_options(estimate.kind, estimate.options)


def _presses(
    folder: Path, document: dict[str, Any], calibration: ProbeCalibration, probe: str, progress: Callable[[], None]
) -> Iterator[IncomingPress]:
    taken = modification_time(folder / RESULT)
    entries = [("target", item) for item in document["images"]] + [("plain", item) for item in document["reference"]]
    if not document["images"] or len(entries) > MOST_PRESSES:
        raise InputError(
            f"it must tell of a press on the phantom and of at most {MOST_PRESSES} in all; got {len(entries)}"
        )
    scale = None
    for at, (role, entry) in enumerate(entries):
        path = own_file(folder, from_json_value(str, entry["name"], f"{role}.name"))
        scale = _optional(tuple[float, float], entry["mm_per_pixel"], f"{role}.mm_per_pixel")
        grey = read_frame(path).grey
        if grey_sha256(grey) != entry["sha256"]:
            raise file_error(path, "must be the frame that was estimated; its grey levels are others")
        yield IncomingPress(
            **inspect_file(path),
            role=role,
            taken=taken + timedelta(microseconds=at),  # unknown; this preserves their order
            name=path.name,
            force_n=_optional(float, entry["force_n"], f"{role}.force_n"),
            mm_per_pixel=scale,
            probe=probe,
            calibration=calibration,
            settings=dict(entry["settings"]),
        )
        progress()
    untouched = own_file(folder, UNTOUCHED)
    if untouched.exists():
        yield IncomingPress(
            **inspect_file(untouched),
            role="untouched",
            taken=taken + timedelta(microseconds=len(entries)),
            name=UNTOUCHED,
            force_n=0.0,
            mm_per_pixel=scale,
            probe=probe,
            calibration=calibration,
        )
        progress()


def _optional(kind: type[Value], document: Any, where: str) -> Value | None:
    return None if document is None else from_json_value(kind, document, where)
