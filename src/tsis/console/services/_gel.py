"""A gel sensor before the camera: its file, its untouched frame and depth calibration, and what frames show with it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from tsis.catalog.sensors import load_sensor
from tsis.console.services._frame_analysis import ContactView, FrameAnalysis, exposure_warnings, histogram
from tsis.errors import CameraError, InputError
from tsis.files.reading import read_object
from tsis.imaging import gel_levels
from tsis.imaging.depth import DepthMapper, gel_reading, parse_depth_calibration
from tsis.instrument import read_levels

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.console.services._control import ControlLock
    from tsis.console.services._subject import PressForce
    from tsis.imaging.depth import DepthCalibration
    from tsis.instrument.acquisition import ReceivedFrame
    from tsis.model.gel_sensor import GelSensor


MOST_WEIGHTS = 10**6  # numbers of a depth calibration


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GelSetup:
    """What the analysis of a gel sensor's frames uses.

    Attributes
    ----------
    sensor
        The sensor; None analyses frames as those of a probe.
    reference
        Levels of the untouched sensor; None before they are known.
    calibration
        The depth calibration; None shows no depth and no force.
    """

    sensor: GelSensor | None = None
    reference: NDArray[Any] | None = None
    calibration: DepthCalibration | None = None


class GelAnalysis:
    """Analyses frames of a gel sensor, once one is chosen; safe for several threads.

    Commands name their caller, ``by``, who must own the camera: `ControlError` otherwise. ``newest`` gives the camera's
    newest frame, ``changed`` is called after each command.
    """

    def __init__(
        self, control: ControlLock, newest: Callable[[], ReceivedFrame | None], changed: Callable[[], None]
    ) -> None:
        self._control, self._newest, self._changed = control, newest, changed
        self._mapper: tuple[GelSetup, DepthMapper | None] = GelSetup(), None
        self.setup = GelSetup()

    def use_sensor(self, sensor: str | Path | None, *, by: str) -> None:
        """Choose a sensor of the catalog or of a file, without an untouched frame and a calibration; None for a probe.

        Errors as `tsis.catalog.load_sensor`. The untouched frame that a file names is not read.
        """
        chosen = None if sensor is None else replace(load_sensor(sensor), reference_file=None)
        self._use(GelSetup(sensor=chosen), by)

    def use_reference(self, file: Path | None = None, *, by: str) -> None:
        """Use the untouched sensor of a picture, or the camera's newest frame when None.

        Raises `FileInputError` for another file, `CameraError` without a frame, and as `tsis.imaging.gel_levels`.
        """
        sensor, received = self._chosen(), self._newest()
        if file is None and received is None:
            raise CameraError("the camera must run for this; it is stopped (start it)")
        levels = levels_of(received) if file is None and received is not None else read_levels(file or "")
        gel_levels(levels, sensor, what="the untouched frame")
        self._use(replace(self.setup, reference=levels), by)

    def use_calibration(self, file: Path | None, *, by: str) -> None:
        """Use the depth calibration of a file that ``tsis depth calibrate`` wrote; None for none."""
        sensor = self._chosen()
        calibration = None if file is None else parse_depth_calibration(read_object(file, values=MOST_WEIGHTS))
        if calibration is not None and calibration.sensor != sensor.name:
            raise InputError(f"the depth calibration must be of {sensor.name}; got one of {calibration.sensor!r:.80}")
        self._use(replace(self.setup, calibration=calibration), by)

    def analyse(self, received: ReceivedFrame, number: int, force: PressForce | None) -> FrameAnalysis | None:
        """Analysis of frame ``number``; None without a sensor and its untouched frame. Errors as `gel_reading`."""
        setup = self.setup
        if setup.sensor is None or setup.reference is None:
            return None
        if self._mapper[0] is not setup:
            depth = setup.calibration
            self._mapper = setup, None if depth is None else DepthMapper(depth, setup.sensor, setup.reference)
        frame, counts = received.frame, histogram(received.frame)
        reading = gel_reading(
            levels_of(received), sensor=setup.sensor, reference=setup.reference, mapper=self._mapper[1]
        )
        contact, clipped = None, float((frame.pixels >= frame.full_scale).mean())
        if reading.centre_px is not None:
            contact = ContactView(centroid_px=reading.centre_px, outline_px=reading.outline_px)
        return FrameAnalysis(
            number=number,
            flags=(),
            force=force,
            still="",
            contact=contact,
            histogram=tuple(counts.tolist()),
            clipped_share=clipped,
            warnings=exposure_warnings(counts, clipped),
            gel=reading,
        )

    def _chosen(self) -> GelSensor:
        if self.setup.sensor is None:
            raise InputError("a gel sensor must be chosen for this; none is (choose one on the page Gel sensor)")
        return self.setup.sensor

    def _use(self, setup: GelSetup, by: str) -> None:
        self._control.require(by)
        self.setup = setup
        self._changed()


def levels_of(received: ReceivedFrame) -> NDArray[Any]:
    """A frame in colour where the camera has colours, else in grey."""
    frame = received.frame
    return frame.pixels if frame.colour is None else frame.colour
