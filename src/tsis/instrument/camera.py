"""The camera protocol: modes, settings, frames, and loss of the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from tsis.errors import CameraError, ImageMismatchError
from tsis.model.content import ContentValue
from tsis.model.image import TactileImage
from tsis.model.require import require_array, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from numpy.typing import NDArray


SILENT_S = 1.0
LATE_FRAMES = 3.0  # of a camera whose frames take longer


def silence_timeout_s(values: Mapping[str, float]) -> float:
    """Silence after which a running camera with these settings counts as lost: 1 s, or three frames if that is longer.

    Examples
    --------
    >>> silence_timeout_s({"frames_per_s": 30.0, "exposure_ms": 20.0}), silence_timeout_s({"frames_per_s": 0.5})
    (1.0, 6.0)
    """
    rate = values.get("frames_per_s", 0.0)
    period_s = max(1.0 / rate if rate > 0 else 0.0, values.get("exposure_ms", 0.0) / 1000.0)
    return max(SILENT_S, LATE_FRAMES * period_s)


LONGEST_LOOK_S = 0.5


class AwakeClock:
    """Seconds during which a reader looked: a step of over half a second between two looks counts as half a second.

    Its program, or its machine, was stopped then, and what arrived meanwhile has yet to be read. It is no silence.

    Examples
    --------
    >>> looks = iter([10.0, 10.1, 13.1, 13.2])
    >>> awake = AwakeClock(lambda: next(looks))
    >>> [round(awake(), 3) for _ in range(3)]
    [10.1, 10.6, 10.7]
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._looked_s, self._stopped_s = clock(), 0.0

    def __call__(self) -> float:
        """The time now, less that of the stops."""
        now_s = self._clock()
        self._stopped_s += max(0.0, now_s - self._looked_s - LONGEST_LOOK_S)
        self._looked_s = now_s
        return now_s - self._stopped_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """A format in which a camera delivers frames.

    Parameters
    ----------
    width_px, height_px
        Size of a frame in pixels.
    full_scale
        Grey level at which the source clips, 255 for 8 bits.
    frames_per_s
        Nominal rate; None when the source has no clock.
    pixel_format
        The driver's name of the pixel format, e.g. ``"Mono8"``; empty without one.

    Examples
    --------
    >>> Mode(width_px=768, height_px=492, frames_per_s=30, pixel_format="Mono8").label
    'Mono8-768x492@30'
    """

    width_px: int
    height_px: int
    full_scale: float = 255.0
    frames_per_s: float | None = None
    pixel_format: str = ""

    def __post_init__(self) -> None:
        require_number("width_px", self.width_px, 1, 65535, hint="pixels")
        require_number("height_px", self.height_px, 1, 65535, hint="pixels")
        require_number("full_scale", self.full_scale, 1.0, 65535.0)
        if self.frames_per_s is not None:
            require_number("frames_per_s", self.frames_per_s, 1e-3, 1e5)
        require_type("pixel_format", self.pixel_format, str)

    @property
    def label(self) -> str:
        """Name of the mode in lists and options."""
        kind = f"{self.pixel_format}-" if self.pixel_format else ""
        rate = "" if self.frames_per_s is None else f"@{self.frames_per_s:.4g}"
        return f"{kind}{self.width_px}x{self.height_px}{rate}"


def named_mode(modes: Iterable[Mode], label: str) -> Mode:
    """The mode of that label; `UnknownNameError` when there is none; the message suggests the nearest."""
    by_label = {mode.label: mode for mode in modes}
    return by_label[require_one_of("mode", label, by_label)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """An adjustable number of a camera, with its range.

    Parameters
    ----------
    name
        Name, e.g. ``"gain"``.
    value
        Present value.
    low, high
        The range, ends included; infinite where the driver gives none.
    unit
        Unit of the three numbers; empty for the driver's own.

    Examples
    --------
    >>> Setting(name="gain", value=2.0, low=0.0, high=24.0, unit="dB").checked(6)
    6.0
    """

    name: str
    value: float
    low: float = -np.inf
    high: float = np.inf
    unit: str = ""

    def checked(self, value: float) -> float:
        """Return ``value`` if it lies in the range."""
        return require_number(self.name, value, self.low, self.high, hint=self.unit)


def checked_setting(settings: Iterable[Setting], name: str, value: float, *, camera: str) -> float:
    """The value for the setting of that name, if it lies in its range.

    Raises `UnknownNameError`, `InputError` outside its range, and `CameraError` when the camera has no settings.
    """
    by_name = {setting.name: setting for setting in settings}
    if not by_name:
        raise CameraError(f"{camera} has no setting called {name!r}; it has none at all")
    return by_name[require_one_of("setting", name, by_name)].checked(value)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame(ContentValue):
    """A raw frame of a camera.

    Parameters
    ----------
    pixels
        Grey levels, shape (rows, columns), finite; copied read-only with their dtype.
    sequence
        Number of the frame since ``start``, from 0; a gap means dropped frames.
    time_s
        Seconds since the first frame on the camera's clock; None without one.
    full_scale
        Grey level at which the source clips, 255 for 8 bits.
    name
        Name in reports, e.g. the file's name.
    settings
        Settings of the camera.
    colour
        Levels in red-green-blue as the source gave them, shape (rows, columns, 3), for gel sensors; None of a grey
        source. ``pixels`` are the grey levels of the same frame.
    """

    pixels: NDArray[Any]
    sequence: int
    time_s: float | None = None
    full_scale: float = 255.0
    name: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    colour: NDArray[Any] | None = None

    def __post_init__(self) -> None:
        pixels = np.asarray(self.pixels)
        object.__setattr__(self, "pixels", require_array("pixels", pixels, ndim=2, dtype=pixels.dtype.type))
        require_number("sequence", self.sequence, 0, 2**63)
        require_number("full_scale", self.full_scale, 1.0, 65535.0)
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))
        if self.colour is not None:
            colour = require_array("colour", self.colour, ndim=3, dtype=np.asarray(self.colour).dtype.type)
            if colour.shape != (*self.pixels.shape, 3):
                raise ImageMismatchError(
                    f"colour must have the shape {(*self.pixels.shape, 3)}, as the grey levels; got {colour.shape}"
                )
            object.__setattr__(self, "colour", colour)

    @property
    def nbytes(self) -> int:
        """Size of the levels in bytes."""
        return int(self.pixels.nbytes + (0 if self.colour is None else self.colour.nbytes))

    def tactile_image(
        self, *, mm_per_pixel: tuple[float, float] | None = None, force_n: float | None = None
    ) -> TactileImage:
        """The frame as an image of a press: ``mm_per_pixel`` is (x, y) in mm, ``force_n`` in newtons."""
        return TactileImage(
            grey=self.pixels,
            mm_per_pixel=mm_per_pixel,
            full_scale=self.full_scale,
            force_n=force_n,
            name=self.name,
            settings=self.settings,
        )


@runtime_checkable
class Camera(Protocol):
    """A source of frames."""

    @property
    def name(self) -> str:
        """Display name."""

    @property
    def lost(self) -> bool:
        """True when the stream ended before it was stopped or before its declared end."""

    def open(self) -> None:
        """Connect to the source; `CameraError` or `FileInputError` when that fails."""

    def modes(self) -> tuple[Mode, ...]:
        """The available modes, the default first."""

    def settings(self) -> tuple[Setting, ...]:
        """The adjustable settings with present values and ranges; empty for stored frames."""

    def adjust(self, name: str, value: float) -> None:
        """Change one setting; `UnknownNameError` or `InputError` for another name or a value out of range."""

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames in ``mode``, or in the default one."""

    def frames(self) -> Iterator[Frame]:
        """Yield frames until the source ends or is stopped; frames already yielded stay valid when it is lost."""

    def stop(self) -> None:
        """End the stream and release the source; another call does nothing."""


PRESETS = ("default", "minimal")
# Settings of the light (brightness, gain, shutter), as cameras name them.
_OF_LIGHT = frozenset({"brightness", "gain", "gain_db", "exposure", "exposure_ms"})


def preset(name: str, settings: Iterable[Setting]) -> dict[str, float]:
    """Values of the settings that a preset changes, by name; `UnknownNameError` when there is no such preset.

    Parameters
    ----------
    name
        ``"default"``: the values of ``settings``. ``"minimal"``: the camera's lowest brightness, gain and exposure,
        where its driver gives them.
    settings
        The camera's settings just after opening.

    Examples
    --------
    >>> settings = [Setting(name="exposure_ms", value=20.0, low=0.1, high=33.0, unit="ms")]
    >>> preset("minimal", settings), preset("default", settings)
    ({'exposure_ms': 0.1}, {'exposure_ms': 20.0})
    """
    minimal = require_one_of("preset", name, PRESETS) == "minimal"
    light = [setting for setting in settings if setting.name in _OF_LIGHT]
    if not minimal:
        return {setting.name: setting.value for setting in light}
    return {setting.name: setting.low for setting in light if math.isfinite(setting.low)}
