"""The press guard on one frame, and on a live stream with its history."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.calibration.guard.limits import GuardLimits, limit_excesses
from tsis.calibration.guard.reading import FrameShape, GuardReference, prepare_reference, read_guard_frame
from tsis.calibration.settling import BINS, LONGEST_HOLD_S, assess_history
from tsis.catalog.probes import list_probes, load_probe
from tsis.imaging.corrections import require_image
from tsis.model.image import TactileImage
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.frames import UsableCalibration
    from tsis.calibration.guard.limits import GuardFlag
    from tsis.calibration.guard.reading import GuardReading, Prepared
    from tsis.calibration.settling import Settling
    from tsis.instrument.camera import Frame


LAMPS_HZ = (100.0, 120.0)
FRAMES = 64  # newest frames in the fit: two seconds at 30 frames a second
FEWEST = 16
LEAST_PERIODS = 1.5  # of the alias in the series: a slower oscillation looks like a trend
CONFUSED = 2.0  # variance of the amplitude over that of even sampling; beyond, stalled frames alias trends
SIGNIFICANT = 5.0  # standard deviations of the amplitude; the series is tested at every frame
LEAST_NOISY = 0.01  # of the pixels: stuck ones of a black picture are fewer


def flicker_amplitude(time_s: Sequence[float], level: Sequence[float]) -> float | None:
    """Amplitude at the mains' frequencies in a series of levels.

    Frames more than half a period apart alias the flicker to a lower frequency; a fit at the times of the frames
    still gives its amplitude. Where the alias is near zero (100 Hz at 25 or 50 frames a second), every frame has the
    same phase and the amplitude is unknown, None. It is 0 when it does not stand out of the noise.

    Examples
    --------
    >>> time = np.arange(64) / 30.0
    >>> round(flicker_amplitude(time, 8.0 + 0.5 * np.cos(2 * np.pi * 100.0 * time)), 3)
    0.5
    """
    if len(time_s) < FEWEST:
        return None
    time = np.asarray(time_s) - time_s[0]
    values = np.asarray(level, dtype=float)
    amplitudes = [_amplitude(time, values, hertz) for hertz in LAMPS_HZ]
    return max((amplitude for amplitude in amplitudes if amplitude is not None), default=None)


def _amplitude(time: NDArray[np.float64], values: NDArray[np.float64], hertz: float) -> float | None:
    angle = 2 * np.pi * hertz * time
    rate = (len(time) - 1) / time[-1]
    alias = abs((hertz + rate / 2) % rate - rate / 2)
    if alias * time[-1] < LEAST_PERIODS:
        return None
    steady = time / time[-1]
    columns = np.column_stack([np.ones_like(time), steady, steady**2, np.cos(angle), np.sin(angle)])
    weights, _, rank, _ = np.linalg.lstsq(columns, values, rcond=1e-6)
    if rank < columns.shape[1]:
        return None
    inverse = np.linalg.inv(columns.T @ columns)
    spread = float(inverse[3, 3] + inverse[4, 4]) / 2
    if spread * len(time) / 2 > CONFUSED:
        return None
    residuals = values - columns @ weights
    variance = float(residuals @ residuals) / (len(time) - columns.shape[1]) * spread
    amplitude = float(np.hypot(weights[3], weights[4]))
    return amplitude if amplitude > SIGNIFICANT * np.sqrt(variance) else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _RepeatedFrames:
    """Number of identical pictures in a row; sensor noise never repeats."""

    checksum: int | None = None  # of the newest picture's pixels; None before the first
    count: int = 0  # of identical frames up to the newest

    def with_picture(self, pixels: NDArray[Any]) -> _RepeatedFrames:
        """The count after one more picture."""
        checksum = zlib.crc32(np.ascontiguousarray(pixels).data)
        again = checksum == self.checksum
        if again:  # and enough pixels lie between the picture's extremes to show noise
            again = bool(((pixels > pixels.min()) & (pixels < pixels.max())).mean() > LEAST_NOISY)
        return _RepeatedFrames(checksum=checksum, count=self.count + 1 if again else 1)


STEP = 0.05  # a larger relative change between neighbouring bins is another press, not settling


@dataclass(frozen=True, slots=True, kw_only=True)
class PressHistory:
    """Averages of a series since the start of the press.

    Attributes
    ----------
    time_s, value
        Means of the full bins, oldest first, at most `BINS`.
    per_bin
        Samples in each of them, a power of two.
    open_time_s, open_value
        Sums over the samples of the incomplete bin.
    open_count
        Their number.
    last_s
        Time of the newest sample; None before the first.
    """

    time_s: tuple[float, ...] = ()
    value: tuple[float, ...] = ()
    per_bin: int = 1
    open_time_s: float = 0.0
    open_value: float = 0.0
    open_count: int = 0
    last_s: float | None = None

    def with_sample(self, time_s: float, value: float) -> PressHistory:
        """The history after one more sample; a new one where time runs back or the value steps.

        Examples
        --------
        >>> history = PressHistory()
        >>> for number in range(1000):
        ...     history = history.with_sample(number / 30, 100.0)
        >>> len(history.value) <= 128, history.per_bin
        (True, 8)
        """
        if self.last_s is not None and time_s <= self.last_s:
            return PressHistory().with_sample(time_s, value)
        grown = replace(
            self,
            open_time_s=self.open_time_s + time_s,
            open_value=self.open_value + value,
            open_count=self.open_count + 1,
            last_s=time_s,
        )
        return grown._closed(time_s, value) if grown.open_count == self.per_bin else grown

    def _closed(self, time_s: float, value: float) -> PressHistory:
        mean_s, mean = self.open_time_s / self.open_count, self.open_value / self.open_count
        if self.value and abs(mean - self.value[-1]) > STEP * abs(mean):
            return PressHistory(time_s=(time_s,), value=(value,), last_s=time_s)
        times, values = (*self.time_s, mean_s), (*self.value, mean)
        if len(times) < BINS:
            return PressHistory(time_s=times, value=values, per_bin=self.per_bin, last_s=self.last_s)
        pairs = range(0, BINS, 2)
        return PressHistory(
            time_s=tuple((times[i] + times[i + 1]) / 2 for i in pairs),
            value=tuple((values[i] + values[i + 1]) / 2 for i in pairs),
            per_bin=2 * self.per_bin,
            last_s=self.last_s,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchState:
    """State of a watch between frames, of bounded size.

    Attributes
    ----------
    raised
        Names of the raised flags.
    history
        Light of the present press.
    outside
        Time and level outside the contact, of the newest frames.
    stillness
        Number of identical pictures in a row.
    reading, settling
        Of the newest frame; None before the first; ``settling`` also without contact or times.
    """

    raised: frozenset[str] = frozenset()
    history: PressHistory = field(default_factory=PressHistory)
    outside: tuple[tuple[float, float], ...] = ()
    stillness: _RepeatedFrames = field(default_factory=_RepeatedFrames)
    reading: GuardReading | None = None
    settling: Settling | None = None


class PressWatch:
    """A press guard for the frames of one camera in one mode.

    A flag is raised when its value passes the limit, and cleared when the value is back below ``release`` times the
    limit. The hysteresis prevents flags from flickering at a limit.

    Raises `InputError` when an argument has the wrong type; `ImageMismatchError` when the reference is of another size
    or depth than the frames.

    Parameters
    ----------
    shape
        Of the frames: ``FrameShape.of(image)``.
    reference
        What presses are compared with.
    limits
        The thresholds.
    longest_s
        Longest assumed time constant of the tissue, s: see `tsis.calibration.settling.assess_settling`.

    Examples
    --------
    >>> from tsis.instrument.camera import Frame
    >>> from tsis.model.image import TactileImage
    >>> untouched = TactileImage(grey=np.full((120, 160), 8.0))
    >>> watch = PressWatch(FrameShape.of(untouched), reference=GuardReference(untouched=untouched))
    >>> flags, state = watch.step(WatchState(), Frame(pixels=untouched.grey, sequence=0, time_s=0.0))
    >>> [flag.name for flag in flags]
    ['no-contact']
    """

    def __init__(
        self,
        shape: FrameShape,
        *,
        reference: GuardReference | None = None,
        limits: GuardLimits | None = None,
        longest_s: float = LONGEST_HOLD_S,
    ) -> None:
        require_type("shape", shape, FrameShape)
        reference = GuardReference() if reference is None else reference
        require_type("reference", reference, GuardReference)
        self.limits = GuardLimits() if limits is None else limits
        require_type("limits", self.limits, GuardLimits)
        self._longest_s = require_number("longest_s", longest_s, 1e-2, 1e5, hint="seconds")
        self._prepared: Prepared = prepare_reference(reference, shape)

    def step(
        self, state: WatchState, frame: Frame, force_n: float | None = None
    ) -> tuple[tuple[GuardFlag, ...], WatchState]:
        """Check the next frame.

        Raises `ImageMismatchError` when the frame is of another size or depth; `InputError` when the force lies outside
        [0, 1000] N.

        Parameters
        ----------
        state
            Returned by the step before; ``WatchState()`` at the start.
        frame
            The raw camera frame. Without ``time_s`` neither settling nor flicker is checked; a time that runs back,
            after a camera was lost, begins a new press.
        force_n
            Force of the gauge at that time, N; None when unknown.

        Returns
        -------
        tuple of GuardFlag
            Raised flags.
        WatchState
            For the next step.
        """
        self._prepared.check_fits(frame.pixels, frame.full_scale)
        if force_n is not None:
            require_number("force_n", force_n, 0.0, 1000.0, hint="newtons")
        reading = read_guard_frame(frame.pixels, self._prepared, force_n=force_n)
        history, outside = self._remembered(state, frame.time_s, reading)
        # Between two complete bins the series is the same, and so is the result.
        settling = state.settling if history.time_s is state.history.time_s else self._assess(history)
        stillness = state.stillness.with_picture(frame.pixels)
        flicker_grey = flicker_amplitude([time_s for time_s, _ in outside], [level for _, level in outside])
        excesses = limit_excesses(
            reading, self.limits, settling=settling, flicker_grey=flicker_grey, in_a_row=stillness.count
        )
        up = tuple(
            flag for flag, excess in excesses if excess > (self.limits.release if flag.name in state.raised else 1.0)
        )
        return up, WatchState(
            raised=frozenset(flag.name for flag in up),
            history=history,
            outside=outside,
            stillness=stillness,
            reading=reading,
            settling=settling,
        )

    def _remembered(
        self, state: WatchState, time_s: float | None, reading: GuardReading
    ) -> tuple[PressHistory, tuple[tuple[float, float], ...]]:
        """Histories with the new frame; those of an earlier press or stream are dropped."""
        if time_s is None:
            return PressHistory(), ()
        touched = reading.contrast > max(self.limits.contact, reading.noise)
        history = state.history.with_sample(time_s, reading.light) if touched else PressHistory()
        if reading.outside_grey is None:
            return history, ()
        earlier = state.outside if not state.outside or state.outside[-1][0] < time_s else ()
        return history, (*earlier[1 - FRAMES :], (time_s, reading.outside_grey))

    def _assess(self, history: PressHistory) -> Settling | None:
        if history.last_s is None:  # no contact
            return None
        time, value = np.array(history.time_s), np.array(history.value)
        return assess_history(time, value, tolerance=self.limits.moving, longest_s=self._longest_s)


def check_press(
    image: TactileImage,
    *,
    reference: GuardReference | TactileImage | None = None,
    force_n: float | None = None,
    settling: Settling | None = None,
    limits: GuardLimits | None = None,
) -> tuple[GuardFlag, ...]:
    """Flags of a press that should not be used as it is.

    Raises `InputError` when an argument has the wrong type or is out of range; `ImageMismatchError` when the reference
    is of another size, scale or full scale.

    Parameters
    ----------
    image
        The raw camera frame.
    reference
        What the frame is compared with; a frame alone is that of the untouched probe. A flag whose input is missing
        is not checked: see `tsis.calibration.guard.limits.GUARD_FLAGS`.
    force_n
        Force of the gauge, N, in [0, 1000]; that of the image when None.
    settling
        Settling of the series that ends in this frame, by `tsis.calibration.settling.assess_settling`; None leaves
        ``moving`` unchecked.
    limits
        The thresholds; those of `GuardLimits` when None.

    Returns
    -------
    tuple of GuardFlag
        Raised flags, in the order in which they are best corrected; empty for a usable press.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[-60:60, -80:80]
    >>> press = TactileImage(grey=8.0 + 120.0 * np.exp(-(x**2 + y**2) / 600.0), force_n=2.3)
    >>> untouched = TactileImage(grey=np.full((120, 160), 8.0))
    >>> for flag in check_press(press, reference=untouched):
    ...     print(f"{flag.name}: {flag.advice}")
    force-too-large: press less: 2.3 N is above 2 N
    """
    require_image("image", image)
    if isinstance(reference, TactileImage) or reference is None:
        reference = GuardReference(untouched=reference)
    require_type("reference", reference, GuardReference)
    limits = GuardLimits() if limits is None else limits
    require_type("limits", limits, GuardLimits)
    force = image.force_n if force_n is None else require_number("force_n", force_n, 0.0, 1000.0, hint="newtons")
    reading = read_guard_frame(image.grey, prepare_reference(reference, FrameShape.of(image)), force_n=force)
    return tuple(flag for flag, excess in limit_excesses(reading, limits, settling=settling) if excess > 1.0)


def guard_reference(calibration: UsableCalibration | None) -> GuardReference:
    """The untouched probe of a calibration; an empty reference without one."""
    if calibration is None or calibration.calibration.reference is None:
        return GuardReference()
    reference, probe = calibration.calibration.reference, calibration.calibration.probe
    return GuardReference(
        untouched=TactileImage(
            grey=reference.dark_grey + reference.untouched_grey,
            mm_per_pixel=_scale(calibration),
            full_scale=reference.full_scale,
        ),
        patch=reference.patch,
        face_radius_mm=load_probe(probe).radius_mm if probe in list_probes() else None,
        dark_grey=float(reference.dark_grey.mean()),
    )


def press_watch(frame: Frame, calibration: UsableCalibration | None) -> PressWatch:
    """A guard for the stream of this frame."""
    shape = FrameShape.of(frame.tactile_image(mm_per_pixel=_scale(calibration)))
    return PressWatch(shape, reference=guard_reference(calibration))


def with_calibrated_scale(image: TactileImage, calibration: UsableCalibration | None) -> TactileImage:
    """A frame with the calibration's scale, if any; `ImageMismatchError` when its size differs."""
    scale = None if calibration is None else calibration.calibration.scale
    return image if scale is None else scale.on(image)


def _scale(calibration: UsableCalibration | None) -> tuple[float, float] | None:
    scale = None if calibration is None else calibration.calibration.scale
    return None if scale is None else scale.mm_per_pixel
