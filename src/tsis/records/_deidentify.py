"""De-identified target records: a pseudonym that only the store can resolve, and no free text."""

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
    """The permanent pseudonym of a target; without the secret of the store it cannot be resolved.

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> from tsis.records import Target, TargetRecord
    >>> target = Target(number=3, kind="subject", made=datetime(2026, 11, 22, tzinfo=UTC), id="a")
    >>> pseudonym(TargetRecord(target=target, presses=(), read={}.__getitem__, secret="5a" * 32))
    'TSIS-077785083242'
    """
    return "TSIS-" + hidden_identity(record, "pseudonym", record.target.id)[:DIGITS].upper()


def hidden_identity(record: TargetRecord, what: str, identity: str) -> str:
    """The substitute of an identity in a de-identified export: as permanent and secret as the pseudonym."""
    return derived(record.secret, what, identity)[:32]


def public_identity(target: Target) -> str:
    """Kind and number of a target, and a hash that distinguishes it from a target of another store."""
    difference = hashlib.sha256(f"tsis target {target.id}".encode()).hexdigest()[:8]
    return f"{target.kind}-{target.number:05d}-{difference}"


CAMERA = "a camera"
DAMAGED = "a stored file is not as it was stored (tsis records verify says which)"  # its path may contain a name
CAMERA_SOURCES = ("virtual", "virtual loading machine")  # of frames that this program simulated


def deidentified(record: TargetRecord) -> TargetRecord:
    """The record without identifying content.

    Target, presses and estimates get other identities, derived from the secret of the store; the target gets its
    pseudonym. Labels, frame names, notes, settings and true values are removed. Only probes of the catalog and flags of
    this program remain by name. Texts are composed anew from the numbers.
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
    """Whether a frame came from a camera, which writes no text into its pixels, and not from an image file.

    The settings of an image file contain its format; those of a camera frame name the camera or the simulation.
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
    """New name by probe: the name in the catalog, or a number in the order of occurrence."""
    cataloged = {"", *list_probes()}
    others = [name for name in dict.fromkeys(names) if name not in cataloged]
    numbered = {name: f"other probe {number}" for number, name in enumerate(others, 1)}
    return {name: name for name in cataloged} | (numbered if len(others) > 1 else dict.fromkeys(others, "other probe"))


def _press(record: TargetRecord, press: StoredPress, probes: Mapping[str, str], target: str) -> StoredPress:
    return replace(
        press,
        probe=probes[press.probe],
        flags=distinct(press.flags, PRESS_FLAGS),
        settings={"camera": CAMERA} if from_camera(press) else {},
        name="",
        note="",
        id=_optional_identity(record, "press", press.id),
        target=target,
    )


def _stored(
    record: TargetRecord, stored: StoredEstimate, probes: Mapping[str, str], numbers: Mapping[str, int], target: str
) -> StoredEstimate:
    supersedes = stored.supersedes
    return replace(
        deidentified_estimate(stored, {name: f"press {number}" for name, number in numbers.items()}),
        probe=probes[stored.probe],
        presses=tuple(_optional_identity(record, "press", press) for press in stored.presses),
        calibration=stored.calibration if SHA256.fullmatch(stored.calibration) else "",
        supersedes=None if supersedes is None else _optional_identity(record, "estimate", supersedes),
        id=_optional_identity(record, "estimate", stored.id),
        target=target,
    )


def _calibration(calibration: ProbeCalibration, name: str, probes: Mapping[str, str]) -> ProbeCalibration:
    """The numbers of a calibration, without its specification sheet."""
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


def _optional_identity(record: TargetRecord, what: str, identity: str) -> str:
    """The hidden identity; empty for a value outside a store."""
    return hidden_identity(record, what, identity) if identity else ""
