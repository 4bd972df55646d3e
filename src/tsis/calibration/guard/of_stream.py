"""The press guard on the frames of a camera: what a calibration lets it compare with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.calibration.guard.blocks import FrameShape
from tsis.calibration.guard.reference import GuardReference
from tsis.calibration.guard.watch import PressWatch
from tsis.model import TactileImage, list_probes, load_probe

if TYPE_CHECKING:
    from tsis.calibration.cited import UsableCalibration
    from tsis.instrument import Frame


def guard_reference(calibration: UsableCalibration | None) -> GuardReference:
    """The untouched probe of a calibration; nothing without one."""
    reference = None if calibration is None else calibration.known.reference
    if reference is None:
        return GuardReference()
    return GuardReference(
        untouched=TactileImage(
            grey=reference.dark_grey + reference.untouched_grey,
            mm_per_pixel=_scale(calibration),
            full_scale=reference.full_scale,
        ),
        patch=reference.patch,
        face_radius_mm=_face_radius_mm(calibration),
        dark_grey=float(reference.dark_grey.mean()),
    )


def press_watch(frame: Frame, calibration: UsableCalibration | None) -> PressWatch:
    """A guard for the stream that this frame belongs to."""
    shape = FrameShape.of(frame.tactile_image(mm_per_pixel=_scale(calibration)))
    return PressWatch(shape, reference=guard_reference(calibration))


def with_calibrated_scale(image: TactileImage, calibration: UsableCalibration | None) -> TactileImage:
    """A frame with the calibration's scale, or as it is; `ImageMismatchError` when that was of another size."""
    scale = None if calibration is None else calibration.known.scale
    return image if scale is None else scale.on(image)


def _scale(calibration: UsableCalibration | None) -> tuple[float, float] | None:
    scale = None if calibration is None else calibration.known.scale
    return None if scale is None else scale.mm_per_pixel


def _face_radius_mm(calibration: UsableCalibration | None) -> float | None:
    """Radius of the face of a probe that the catalog knows."""
    name = "" if calibration is None else calibration.known.probe
    return load_probe(name).radius_mm if name in list_probes() else None
