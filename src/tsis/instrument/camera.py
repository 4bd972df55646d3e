"""What a camera is to the rest of tsis: a short protocol, and the values that cross it.

A source of frames (a device, a folder, a video, the virtual probe) is used in one order::

    open -> modes, settings, adjust -> start -> frames -> stop

Live view, saving and reconnection build on these calls alone, so a new camera is one class with nine members.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from tsis.model import TactileImage
from tsis.model.check import require_array, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """One way in which a source can deliver frames.

    Parameters
    ----------
    width_px, height_px
        Size of a frame in pixels.
    full_scale
        Grey level at which the source clips, 255 for 8 bits.
    frames_per_s
        Nominal rate; None when the source has no clock.
    pixel_format
        What the source calls the pixels, e.g. ``"Mono8"``; empty when it has no name for them.

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
        """How lists name it and a user chooses it."""
        kind = f"{self.pixel_format}-" if self.pixel_format else ""
        rate = "" if self.frames_per_s is None else f"@{self.frames_per_s:.4g}"
        return f"{kind}{self.width_px}x{self.height_px}{rate}"


def named_mode(modes: Iterable[Mode], label: str) -> Mode:
    """The mode of that label.

    Raises
    ------
    UnknownNameError
        When there is none; the nearest is suggested.
    """
    by_label = {mode.label: mode for mode in modes}
    return by_label[require_one_of("mode", label, by_label)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A number that a source lets one set, with its range.

    Parameters
    ----------
    name
        What it is called, e.g. ``"gain"``.
    value
        What it is now.
    low, high
        The range, ends included; infinite where the driver does not tell.
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
        """Return ``value`` when the range holds it, else say why not."""
        return require_number(self.name, value, self.low, self.high, hint=self.unit)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """One frame as the source delivered it.

    Parameters
    ----------
    pixels
        Grey levels, shape (rows, columns), finite; kept as a read-only copy of its own dtype.
    sequence
        Number of the frame since ``start``, from 0; a gap says that frames were dropped.
    time_s
        Seconds since the first frame on the source's clock; None when it has none.
    full_scale
        Grey level at which the source clips, 255 for 8 bits.
    name
        What reports call it, e.g. the file's name.
    settings
        What the source was set to.
    """

    pixels: NDArray[Any]
    sequence: int
    time_s: float | None = None
    full_scale: float = 255.0
    name: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        pixels = np.asarray(self.pixels)
        object.__setattr__(self, "pixels", require_array("pixels", pixels, ndim=2, dtype=pixels.dtype.type))
        require_number("sequence", self.sequence, 0, 2**63)
        require_number("full_scale", self.full_scale, 1.0, 65535.0)
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))

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
        """What a person calls the source."""

    @property
    def lost(self) -> bool:
        """True when the stream ended before it was stopped or before its declared end."""

    def open(self) -> None:
        """Take hold of the source; `CameraError` or `FileInputError` when that cannot be done."""

    def modes(self) -> tuple[Mode, ...]:
        """The modes it can be started in, the default first."""

    def settings(self) -> tuple[Setting, ...]:
        """What can be adjusted, with present values and ranges; empty for stored frames."""

    def adjust(self, name: str, value: float) -> None:
        """Change one setting; `UnknownNameError` or `InputError` when it has none of that name or range."""

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames in ``mode``, or in the default one."""

    def frames(self) -> Iterator[Frame]:
        """Yield frames until the source ends or is stopped; frames already yielded stay valid when it is lost."""

    def stop(self) -> None:
        """End the stream and let go of the source; calling it again does nothing."""
