"""Cameras of any maker through GenTL, the GenICam standard's own driver interface, by the library Harvesters.

The maker's software brings a GenTL producer (a ``.cti`` file) and sets the environment variable
``GENICAM_GENTL64_PATH`` to its folder.
"""

from __future__ import annotations

import contextlib
import time
from typing import TYPE_CHECKING, Any

from tsis.instrument.found import CameraInfo
from tsis.instrument.sources import genicam_producers
from tsis.instrument.sources.genicam_camera import GenICamCamera
from tsis.instrument.sources.genicam_link import cannot_open, none_found
from tsis.instrument.sources.genicam_producers import PATH_VARIABLE, PRODUCERS
from tsis.instrument.sources.harvesters_link import HarvestersLink
from tsis.model.errors import CameraError, MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence
    from pathlib import Path


class HarvestersCamera(GenICamCamera):
    """A camera behind a GenTL producer.

    Parameters
    ----------
    identity
        Its GenTL id, its serial number or the name that its user gave it; the first found when empty.
    producers
        The producers to ask; those of ``GENICAM_GENTL64_PATH`` when None.
    clock
        Seconds, monotonic.
    """

    def __init__(
        self,
        identity: str = "",
        *,
        producers: Sequence[Path] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__("genicam", identity, link=lambda: _opened(identity, _chosen(producers)), clock=clock)


def missing_requirement() -> str | None:
    """What is not installed or not set, and the cure; None when nothing is missing."""
    try:
        genicam_producers.harvesters()
    except MissingExtraError as error:
        return str(error)
    if genicam_producers.producer_files():
        return None
    return (
        "the camera source genicam needs a GenTL producer (a .cti file of the camera maker's software) and found none; "
        f"install that software, or set {PATH_VARIABLE} to the folder of the file"
    )


def find_cameras_here(producers: Sequence[Path] | None = None) -> tuple[CameraInfo, ...]:
    """The cameras that the producers list now.

    Raises
    ------
    CameraError
        When there is none and a producer cannot be loaded.
    """
    return tuple(
        CameraInfo(
            source="genicam",
            identity=device.id_,
            maker=_told(device, "vendor"),
            model=_told(device, "model"),
            note=file.name,
        )
        for device, file in _listed(_chosen(producers))
    )


def _chosen(producers: Sequence[Path] | None) -> Sequence[Path]:
    return genicam_producers.producer_files() if producers is None else producers


def _told(device: Any, what: str) -> str:
    """One of the words that a producer may tell of a camera; empty when it does not."""
    untold: tuple[type[Exception], ...] = (AttributeError, *genicam_producers.failures())
    try:
        return str(getattr(device, what) or "")
    except untold:
        return ""


def _listed(producers: Sequence[Path]) -> Generator[tuple[Any, Path]]:
    """Each device of each producer, that producer in use meanwhile; one that cannot be loaded is passed over."""
    seen, broken = 0, None
    for file in producers:
        try:
            harvester = PRODUCERS.take(file)
        except CameraError as error:
            broken = error
            continue
        try:
            for device in genicam_producers.devices(harvester):
                seen += 1
                yield device, file
        finally:
            PRODUCERS.give_back(file)
    if broken is not None and not seen:
        raise broken


def _opened(identity: str, producers: Sequence[Path]) -> HarvestersLink:
    if not producers:
        raise CameraError(missing_requirement() or "the camera source genicam was given no GenTL producer")
    others: list[str] = []
    with contextlib.closing(_listed(producers)) as listed:
        for device, file in listed:
            names = device.id_, _told(device, "serial_number"), _told(device, "user_defined_name")
            if not identity or identity in names:
                return _link(device, file)
            others.append(device.id_)
    raise none_found("genicam", identity, others)


def _link(device: Any, file: Path) -> HarvestersLink:
    identity = device.id_
    harvester = PRODUCERS.take(file)
    core = genicam_producers.harvesters()
    chunks_off = core.ParameterSet({core.ParameterKey.ENABLE_AUTO_CHUNK_DATA_UPDATE: False})
    try:
        with genicam_producers.interrupts_kept():
            return HarvestersLink(harvester.create(device, config=chunks_off), identity, file)
    except Exception as error:  # of any kind: Harvesters unpacks and parses a file that the camera sends
        PRODUCERS.give_back(file)
        busy = isinstance(error, genicam_producers.busy_failures())
        raise cannot_open(f"genicam camera {identity}", error, busy=busy) from error
