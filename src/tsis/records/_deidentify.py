"""What exports call a target: a pseudonym that only its store can tell whose it is, or number and kind."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING

from tsis.calibration.guard import GUARD_FLAGS as PRESS_FLAGS
from tsis.catalog import list_probes
from tsis.files import SHA256
from tsis.records._deidentify_estimate import CALIBRATION, deidentified_estimate, distinct
from tsis.records.store import derived

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from tsis.calibration.file import ProbeCalibration
    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredEstimate, StoredPress, Target


DIGITS = 12


def pseudonym(record: TargetRecord) -> str:
    """The same for a target of a store for ever; without the store's secret nobody gets from it to the target.

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> from tsis.records import Target, TargetRecord
    >>> target = Target(number=3, kind="subject", made=datetime(2026, 11, 22, tzinfo=UTC), id="a")
    >>> pseudonym(TargetRecord(target=target, presses=(), read={}.__getitem__, secret="5a" * 32))
    'TSIS-077785083242'
    """
    return "TSIS-" + hidden(record, "pseudonym", record.target.id)[:DIGITS].upper()


def hidden(record: TargetRecord, what: str, identity: str) -> str:
    """What stands for an identity in a de-identified export: as lasting, and as hidden, as the pseudonym."""
    return derived(record.secret, what, identity)[:32]


def shown_identity(target: Target) -> str:
    """Kind and number of a target, which people know it by, and what tells it from that of another store.

    The identity itself stays in the store, and in what is handed from store to store.
    """
    difference = hashlib.sha256(f"tsis target {target.id}".encode()).hexdigest()[:8]
    return f"{target.kind}-{target.number:05d}-{difference}"


CAMERA = "a camera"
DAMAGED = "a stored file is not as it was stored (tsis records verify says which)"  # whose path may tell a name
CAMERA_SOURCES = ("virtual", "virtual loading machine")  # of frames that this program simulated


def deidentified(record: TargetRecord) -> TargetRecord:
    """The same without what may identify.

    Target, presses and estimates have other identities, which follow from the secret of the store; that of the target
    is the pseudonym. Labels, names of frames, notes, settings and true values are gone. A probe keeps its name where it
    is in the catalog, a flag where it is one that this program raises. Sentences are made anew from the numbers.
    """
    probes = _neutral_probes(_probes_named(record))
    numbers = {press.name: number for number, press in enumerate(record.presses, 1) if press.name}
    target = pseudonym(record)
    calibrations = {
        cited: _calibration(calibration, f"{CALIBRATION} {number}", probes)
        for number, (cited, calibration) in enumerate(sorted(record.calibrations.items()), 1)
    }
    return replace(
        record,
        target=replace(record.target, id=target, name="", note="", truth={}),
        damaged=(DAMAGED,) if record.damaged else (),
        presses=tuple(_press(record, press, probes, target) for press in record.presses),
        estimates=tuple(_stored(record, estimate, probes, numbers, target) for estimate in record.estimates),
        calibrations=calibrations,
    )


def from_camera(press: StoredPress) -> bool:
    """Whether a frame is known to come from a camera, which writes nothing into its pixels, and not from a file.

    A file of an image tells its format; what came from a camera tells of which one, or that it was simulated.
    """
    settings = press.settings
    return (bool(settings.get("camera")) and "format" not in settings) or settings.get("source") in CAMERA_SOURCES


def _probes_named(record: TargetRecord) -> Iterable[str]:
    yield from (press.probe for press in record.presses)
    yield from (stored.probe for stored in record.estimates)
    for _, calibration in sorted(record.calibrations.items()):
        yield calibration.probe
        if calibration.response is not None:
            yield calibration.response.probe


def _neutral_probes(names: Iterable[str]) -> dict[str, str]:
    """What each probe is called: by its name in the catalog, or by a number in the order in which they occur."""
    given = {"", *list_probes()}
    others = [name for name in dict.fromkeys(names) if name not in given]
    numbered = {name: f"other probe {number}" for number, name in enumerate(others, 1)}
    return {name: name for name in given} | (numbered if len(others) > 1 else dict.fromkeys(others, "other probe"))


def _press(record: TargetRecord, press: StoredPress, probes: Mapping[str, str], target: str) -> StoredPress:
    return replace(
        press,
        probe=probes[press.probe],
        flags=distinct(press.flags, PRESS_FLAGS),
        settings={"camera": CAMERA} if from_camera(press) else {},
        name="",
        note="",
        id=_hidden(record, "press", press.id),
        target=target,
    )


def _stored(
    record: TargetRecord,
    stored: StoredEstimate,
    probes: Mapping[str, str],
    numbers: Mapping[str, int],
    target: str,
) -> StoredEstimate:
    supersedes = stored.supersedes
    return replace(
        deidentified_estimate(stored, {name: f"press {number}" for name, number in numbers.items()}),
        probe=probes[stored.probe],
        presses=tuple(_hidden(record, "press", press) for press in stored.presses),
        calibration=stored.calibration if SHA256.fullmatch(stored.calibration) else "",
        supersedes=None if supersedes is None else _hidden(record, "estimate", supersedes),
        id=_hidden(record, "estimate", stored.id),
        target=target,
    )


def _calibration(calibration: ProbeCalibration, name: str, probes: Mapping[str, str]) -> ProbeCalibration:
    """Its numbers; the sheet, whose words came from a file, is left out."""
    response = calibration.response
    return replace(
        calibration,
        name=name,
        probe=probes[calibration.probe],
        camera="",
        settings={},
        response=None if response is None else replace(response, name=name, probe=probes[response.probe]),
        specification=None,
    )


def _hidden(record: TargetRecord, what: str, identity: str) -> str:
    """Empty stays empty: what was never stored has no identity."""
    return hidden(record, what, identity) if identity else ""
