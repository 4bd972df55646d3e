"""The newest frame analysed: contact, guard, gel sensor."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.calibration.guard.limits import GuardFlag
from tsis.calibration.guard.reading import FrameShape
from tsis.calibration.guard.watch import PressWatch, WatchState
from tsis.catalog.sensors import load_sensor
from tsis.console.services.choice import PressForce
from tsis.errors import CameraError, InputError, TsisError
from tsis.files.reading import read_object
from tsis.imaging.depth import DepthMapper, GelReading, gel_reading, parse_depth_calibration
from tsis.imaging.gel_change import gel_levels
from tsis.imaging.patch import segment
from tsis.imaging.pixels import block_means
from tsis.instrument.image_files import read_levels
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.calibration.guard.reading import GuardReference
    from tsis.console.services.control import ControlLock
    from tsis.imaging.depth import DepthCalibration
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame
    from tsis.instrument.camera import Frame
    from tsis.model.gel_sensor import GelSensor


BINS, OUTLINE_POINTS = 256, 96  # of the histogram, and of a contact
LARGEST_SIDE_PX = 192  # to which a frame is reduced before the search for its contact
CLIPPED = 0.001  # share of pixels at full scale
DIM, BRIGHT_QUANTILE = 0.15, 0.99  # of the scale, which the brightest hundredth reaches


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactView:
    """The contact in a frame, in its pixels.

    Attributes
    ----------
    centroid_px
        Mean position (x, y) weighted by the signal.
    outline_px
        Points (x, y) of its boundary.
    """

    centroid_px: tuple[float, float]
    outline_px: tuple[tuple[float, float], ...]

    def radius(self, mm_per_pixel: tuple[float, float] = (1.0, 1.0)) -> float:
        """Radius of the circle of the same area as the outline, in mm, or in pixels by default."""
        x, y = np.array(self.outline_px, dtype=float).reshape(-1, 2).T * np.array(mm_per_pixel)[:, None]
        return math.sqrt(abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1))) / 2.0 / math.pi)


@dataclass(frozen=True, slots=True, kw_only=True)
class PressMoment:
    """A moment of a press: seconds of a clock that never goes back, force if known, contact if there is one."""

    time_s: float
    force_n: float | None
    contact: ContactView | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameAnalysis:
    """Analysis of the newest frame.

    Attributes
    ----------
    number
        How many frames had come when it was looked at.
    flags
        What speaks against the press.
    force
        That of the press; None where unknown.
    still
        ``"settled"``, ``"moving"``, ``"wait 4 s"``, or empty where nobody can tell.
    contact
        None when nothing stands out.
    histogram
        Pixels in `BINS` equal bins of grey levels from 0 to full scale.
    clipped_share
        Of the pixels at full scale.
    warnings
        A message for each problem of the exposure.
    gel
        What a gel sensor before the camera shows; None without one.
    """

    number: int
    flags: tuple[GuardFlag, ...]
    force: PressForce | None
    still: str
    contact: ContactView | None
    histogram: tuple[int, ...]
    clipped_share: float
    warnings: tuple[str, ...]
    gel: GelReading | None = None


def analyse_frame(
    watch: PressWatch,
    state: WatchState,
    frame: Frame,
    *,
    number: int,
    force: PressForce | None,
    untouched: NDArray[np.float64] | None,
) -> tuple[FrameAnalysis, WatchState]:
    """Analyse frame ``number`` with the press guard and its state; returns the analysis and the next state.

    ``untouched`` are grey levels of the untouched probe, `reduced`; None when unknown.
    """
    flags, after = watch.step(state, frame, None if force is None else force.value_n)
    if after.settling is not None and after.settling.settled:  # the flag falls a moment later than the verdict
        flags = tuple(flag for flag in flags if flag.name != "moving")
    counts = histogram(frame)
    clipped = float(np.count_nonzero(frame.pixels >= frame.full_scale) / frame.pixels.size)
    analysis = FrameAnalysis(
        number=number,
        flags=flags,
        force=force,
        still="" if after.settling is None else after.settling.text,
        contact=None if any(flag.name == "no-contact" for flag in flags) else contact(frame, untouched),
        histogram=tuple(counts.tolist()),
        clipped_share=clipped,
        warnings=exposure_warnings(counts, clipped),
    )
    return analysis, after


def histogram(frame: Frame) -> NDArray[np.int64]:
    """Pixels in equal bins of grey levels from 0 to full scale, shape (BINS,)."""
    return np.histogram(frame.pixels, BINS, (0.0, frame.full_scale + 1.0))[0]


def exposure_warnings(counts: NDArray[np.int64], clipped_fraction: float) -> tuple[str, ...]:
    """Problems of the exposure, with a cure."""
    bright = int(np.searchsorted(np.cumsum(counts), BRIGHT_QUANTILE * counts.sum())) / BINS
    if clipped_fraction > CLIPPED:
        return (f"{clipped_fraction:.1%} of the pixels are at full scale: shorten the exposure or lower the gain",)
    if bright < DIM:
        return (f"the frame uses {bright:.0%} of the scale: lengthen the exposure, or press",)
    return ()


def reduced(levels: NDArray[Any]) -> NDArray[np.float64]:
    """A frame reduced by means over equal areas to at most `LARGEST_SIDE_PX`."""
    shrink = max(1.0, max(levels.shape) / LARGEST_SIDE_PX)
    return block_means(levels, (max(3, round(levels.shape[0] / shrink)), max(3, round(levels.shape[1] / shrink))))


def contact(frame: Frame, untouched: NDArray[np.float64] | None) -> ContactView | None:
    """The contact in a `reduced` frame; None without one."""
    small = reduced(frame.pixels)
    if untouched is not None and untouched.shape == small.shape:
        small -= untouched
    patch = segment(TactileImage(grey=small, full_scale=frame.full_scale))
    weight = np.where(patch.mask, np.maximum(small - patch.background_grey, 0.0), 0.0)
    if not patch.is_contact or (total := float(weight.sum())) <= 0.0:
        return None
    down, span = (np.arange(count, dtype=float) for count in small.shape)
    back = frame.pixels.shape[1] / small.shape[1], frame.pixels.shape[0] / small.shape[0]

    def full_size(x: float, y: float) -> tuple[float, float]:
        return round((x + 0.5) * back[0] - 0.5, 2), round((y + 0.5) * back[1] - 0.5, 2)

    outline = patch.contour_px[:: max(1, len(patch.contour_px) // OUTLINE_POINTS)]
    return ContactView(
        centroid_px=full_size(float(weight.sum(axis=0) @ span) / total, float(weight.sum(axis=1) @ down) / total),
        outline_px=tuple(full_size(float(x), float(y)) for x, y in outline),
    )


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

        Raises `FileInputError` for another file, `CameraError` without a frame, and as
        `tsis.imaging.gel_change.gel_levels`.
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


MOST_MOMENTS = 400  # at least a minute
EVERY_S = 0.15  # often enough for the eye, and a small part of a core
WAIT_S = 0.25
_log = logging.getLogger(__name__)


class Watcher:
    """A thread that analyses frames until it is closed.

    ``acquisition`` gives the running acquisition, ``reference`` the press guard's reference and its scale (x, y) in mm
    per pixel, ``force`` the force at a frame; acquisition, scale and force may be None. ``gel`` analyses a frame of
    a gel sensor, with its number and force, and returns None where there is no such sensor.
    """

    def __init__(
        self,
        acquisition: Callable[[], Acquisition | None],
        reference: Callable[[], tuple[GuardReference, tuple[float, float] | None]],
        force: Callable[[ReceivedFrame], PressForce | None],
        gel: Callable[[ReceivedFrame, int, PressForce | None], FrameAnalysis | None] = lambda *_: None,
    ) -> None:
        self._acquisition, self._reference, self._force, self._gel = acquisition, reference, force, gel
        self.frame_analysis: FrameAnalysis | None = None  # of the newest frame
        self.failure = ""  # why frames cannot be analysed
        self._moments: deque[PressMoment] = deque(maxlen=MOST_MOMENTS)  # the newest last
        self._anew, self._closing = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="watcher of presses", daemon=True)
        self._thread.start()

    def moments(self) -> tuple[PressMoment, ...]:
        """Force and contact of the last frames that were analysed, the newest last."""
        return tuple(self._moments)

    def begin_anew(self) -> None:
        """Forget the press so far: camera, calibration or what is pressed has changed."""
        self._anew.set()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        watch: PressWatch | None = None
        state, untouched, position = WatchState(), None, 0
        followed: Acquisition | None = None
        spent_s = 0.0
        while not self._closing.wait(max(EVERY_S, spent_s)):  # half of a core at most
            acquisition = self._acquisition()
            away = acquisition is not None and (acquisition.lost or acquisition.ended)
            if acquisition is not followed or away or self._anew.is_set():
                self._anew.clear()
                followed, watch, state, position = acquisition, None, WatchState(), 0
                self.frame_analysis, self.failure = None, ""
                self._moments.clear()
            if acquisition is not None and away:
                position = acquisition.ring.end  # earlier frames are of a press before the interruption
                continue
            if acquisition is None or not acquisition.ring.wait(position, WAIT_S):
                continue
            received, position = acquisition.latest(), acquisition.ring.end
            if received is None:
                continue
            begun_s = time.monotonic()
            try:
                force = self._force(received)
                analysis = self._gel(received, position, force)
                if analysis is None:
                    if watch is None:
                        watch, untouched = self._guard(received)
                    analysis, state = analyse_frame(
                        watch, state, received.frame, number=position, force=force, untouched=untouched
                    )
                self.frame_analysis, self.failure = analysis, ""
                force_n = None if force is None else force.value_n
                self._moments.append(PressMoment(time_s=received.arrived_s, force_n=force_n, contact=analysis.contact))
            except TsisError as error:  # e.g. a calibration of another size; the live view goes on without flags
                self.frame_analysis, self.failure = None, str(error)
            except Exception as error:
                self._fail(error)
            spent_s = time.monotonic() - begun_s

    def _fail(self, error: Exception) -> None:
        """Go on with the live view, and log the error once."""
        message = f"frames cannot be judged because of an unexpected error: {type(error).__name__}: {error}"
        if message != self.failure:
            _log.exception("a frame could not be judged")
        self.frame_analysis, self.failure = None, message

    def _guard(self, frame: ReceivedFrame) -> tuple[PressWatch, NDArray[np.float64] | None]:
        reference, scale = self._reference()
        shape = FrameShape.of(frame.frame.tactile_image(mm_per_pixel=scale))
        untouched = reference.untouched
        return PressWatch(shape, reference=reference), None if untouched is None else reduced(untouched.grey)
