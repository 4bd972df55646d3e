"""The report: what was estimated and how hard was pressed, as a Comprehensive SR of TID 1500."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.records.dicom import codes
from tsis.records.dicom.files import deterministic_uid
from tsis.records.dicom.libraries import highdicom
from tsis.records.dicom.measurements import estimate_group, press_group, text
from tsis.records.dicom.modules import Series, describe

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pydicom.dataset import Dataset

    from tsis.records import TargetRecord
    from tsis.records.dicom.cover import ExportIdentity
    from tsis.records.dicom.series import Stack

SERIES = 9
NO_DATE, NO_TIME = "19000101", "000000"  # a report must have a time; this one says that it was taken out

# The moment at which highdicom made the document; with it, the same export would not be the same.
OF_NOW = ("InstanceCreationDate", "InstanceCreationTime", "ContributingEquipmentSequence")


def has_report(dossier: TargetRecord) -> bool:
    """Whether there is anything to report: an estimate, a force, or a flag."""
    return bool(dossier.estimates) or any(press.force_n is not None or press.flags for press in dossier.presses)


def report(dossier: TargetRecord, cover: ExportIdentity, images: Sequence[tuple[Stack, Dataset]]) -> Dataset:
    """The report on images that are exported with it; it has no UID of its own yet."""
    made = max([stored.made for stored in dossier.in_force] or [press.taken for press in dossier.presses])
    date, time = cover.moment(made) or (NO_DATE, NO_TIME)
    sr = highdicom("sr")
    document: Dataset = sr.ComprehensiveSR(
        evidence=[image for _, image in images],
        content=_content(dossier, cover, images)[0],
        series_instance_uid=deterministic_uid("series", cover.key, "report"),
        series_number=SERIES,
        sop_instance_uid=deterministic_uid("unsealed"),
        instance_number=1,
        manufacturer="tsis",
        is_complete=True,
        content_date=date,
        content_time=time,
        coding_schemes=[
            highdicom("coding_schemes").CodingSchemeIdentificationItem(codes.SCHEME, name=codes.SCHEME_NAME)
        ],
    )
    described = "Estimate and forces, research use only"
    describe(document, cover, Series(number=SERIES, what="report", description=described, modality="SR", started=made))
    for what in OF_NOW:
        del document[what]
    document.ContentDate, document.ContentTime = date, time
    return document


def _content(dossier: TargetRecord, cover: ExportIdentity, images: Sequence[tuple[Stack, Dataset]]) -> Any:
    sr = highdicom("sr")
    places = {  # by the press itself: two may share a frame, and those of no store have no identity
        id(press): (image, number) for stack, image in images for number, press in enumerate(stack.presses, 1)
    }
    groups = [
        estimate_group(stored, cover, [image for stack, image in images if stack.holds(stored.presses)])
        for stored in dossier.in_force
    ]
    groups += [
        press_group(press, cover, *places[id(press)])
        for press in dossier.presses
        if press.force_n is not None or press.flags
    ]
    content = sr.MeasurementReport(
        observation_context=_observer(),
        procedure_reported=codes.own("imaging"),
        imaging_measurements=groups,
    )
    notice = text("notice", RESEARCH_USE_ONLY)
    content[0].ContentSequence.insert(-1, notice)  # readers meet it before any number
    return content


def _observer() -> Any:
    sr = highdicom("sr")
    device = sr.DeviceObserverIdentifyingAttributes(
        uid=deterministic_uid("device", __version__), name="tsis", manufacturer_name="tsis", model_name=__version__
    )
    context = sr.ObserverContext(observer_type=codes.concept(codes.DEVICE), observer_identifying_attributes=device)
    return sr.ObservationContext(observer_device_context=context)
