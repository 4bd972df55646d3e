"""Cameras of any maker through the GenICam standard: their features, their modes, and the stream of their frames.

The libraries of Basler and Harvesters wrap the same node map in classes of their own. `Nodes` is the common part of
the features, with two kinds of values to read and one call to write; `Link` is that of the connection.
"""

from __future__ import annotations

import contextlib
import math
import sys
import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from tsis.errors import CameraError, import_extra
from tsis.instrument.camera import AwakeClock, Frame, Mode, Setting, silence_timeout_s
from tsis.instrument.drivers.frame_numbers import FULL_SCALE, BlockCount
from tsis.instrument.image_files import quiet_decoders
from tsis.model.require import require_one_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberNode:
    """A number of a camera; a switch is a number from 0 to 1.

    Parameters
    ----------
    value
        Present value.
    low, high
        The range in the camera's present state, ends included.
    step
        Distance of the valid values, counted from ``low``; 0 where any is valid.
    unit
        The camera's unit, e.g. ``"us"``; empty without one.
    """

    value: float
    low: float = -math.inf
    high: float = math.inf
    step: float = 0.0
    unit: str = ""

    def nearest(self, value: float) -> float:
        """The nearest valid value.

        Examples
        --------
        >>> NumberNode(value=0, low=2, high=10, step=4).nearest(7.9)
        6.0
        >>> NumberNode(value=0, low=2, high=9, step=4).nearest(100)
        6.0
        """
        if self.step <= 0 or not math.isfinite(self.low):
            return float(min(max(value, self.low), self.high))
        last = math.inf if math.isinf(self.high) else math.floor((self.high - self.low) / self.step)
        return float(self.low + min(max(round((value - self.low) / self.step), 0), last) * self.step)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChoiceNode:
    """A choice of a camera, with its present options."""

    value: str
    options: tuple[str, ...]


class Nodes(Protocol):
    """The node map of one open camera."""

    def read(self, name: str) -> NumberNode | ChoiceNode | None:
        """The value of that name; None when it is absent or not readable now."""

    def write(self, name: str, value: float | str) -> None:
        """Write the value; the library's errors when the camera refuses."""


def number_node(nodes: Nodes, name: str) -> NumberNode | None:
    """The number of that name, or None."""
    node = nodes.read(name)
    return node if isinstance(node, NumberNode) else None


def choice_node(nodes: Nodes, name: str) -> ChoiceNode | None:
    """The choice of that name, or None."""
    node = nodes.read(name)
    return node if isinstance(node, ChoiceNode) else None


def first_number(nodes: Nodes, names: Iterable[str]) -> tuple[str, NumberNode] | None:
    """The first of the names with a number: newer names come before older ones."""
    for name in names:
        node = number_node(nodes, name)
        if node is not None:
            return name, node
    return None


def set_choice(nodes: Nodes, name: str, option: str) -> None:
    """Set a choice, where the camera has it, offers that option, and has another value."""
    node = choice_node(nodes, name)
    if node is not None and node.value != option and option in node.options:
        nodes.write(name, option)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Feature:
    """The camera's nodes of a setting, and the nodes that must be off or on for it."""

    nodes: tuple[str, ...]
    scale: float = 1.0  # of our unit to the camera's
    unit: str = ""  # ours; the camera's own when empty
    automatic: str = ""
    switches: tuple[str, ...] = ()


_FEATURES: Mapping[str, _Feature] = {
    "exposure_ms": _Feature(
        nodes=("ExposureTime", "ExposureTimeAbs"), scale=1000.0, unit="ms", automatic="ExposureAuto"
    ),
    "gain": _Feature(nodes=("Gain", "GainRaw"), automatic="GainAuto"),
    "brightness": _Feature(nodes=("BlackLevel", "BlackLevelRaw"), automatic="BlackLevelAuto"),
    "frames_per_s": _Feature(
        nodes=("AcquisitionFrameRate", "AcquisitionFrameRateAbs"),
        unit="1/s",
        automatic="AcquisitionFrameRateAuto",
        switches=("AcquisitionFrameRateEnable", "AcquisitionFrameRateEnabled"),
    ),
}


def settings(nodes: Nodes) -> tuple[Setting, ...]:
    """The available settings, with their present values and ranges."""
    nodes_of = ((name, first_number(nodes, feature.nodes)) for name, feature in _FEATURES.items())
    return tuple(_setting(name, node[1]) for name, node in nodes_of if node is not None)


def adjust(nodes: Nodes, name: str, value: float) -> None:
    """Change one setting, and switch off its automatic control.

    Raises `UnknownNameError` when the camera has no such setting; `InputError` when the value lies outside its range;
    `CameraError` when the camera has no settings, or refuses.
    """
    present = {setting.name: setting for setting in settings(nodes)}
    if not present:
        raise CameraError(f"the camera has no setting called {name!r}; it has none at all")
    feature = _FEATURES[require_one_of("setting", name, present)]
    if feature.automatic:
        set_choice(nodes, feature.automatic, "Off")
    for switch in feature.switches:
        switch_node = number_node(nodes, switch)
        if switch_node is not None and switch_node.value == 0:
            nodes.write(switch, 1)
    named_node = first_number(nodes, feature.nodes)  # read again: the switches may have changed the range
    if named_node is None:
        raise CameraError(f"the camera no longer reports its {name}")
    node_name, node = named_node
    checked = _setting(name, node).checked(value)
    nodes.write(node_name, node.nearest(checked * feature.scale))


def run_free(nodes: Nodes) -> None:
    """Switch off the trigger and automatic controls: frames follow each other with constant settings."""
    set_choice(nodes, "AcquisitionMode", "Continuous")
    for feature in _FEATURES.values():
        if feature.automatic:
            set_choice(nodes, feature.automatic, "Off")
    selector = choice_node(nodes, "TriggerSelector")
    if selector is None:
        set_choice(nodes, "TriggerMode", "Off")
        return
    for option in selector.options:
        set_choice(nodes, "TriggerSelector", option)
        set_choice(nodes, "TriggerMode", "Off")
    set_choice(nodes, "TriggerSelector", selector.value)


def _setting(name: str, number_node: NumberNode) -> Setting:
    feature = _FEATURES[name]
    low, high = (end / feature.scale if math.isfinite(end) else end for end in (number_node.low, number_node.high))
    return Setting(
        name=name, value=number_node.value / feature.scale, low=low, high=high, unit=feature.unit or number_node.unit
    )


def maker_library(name: str, *, source: str) -> Any:
    """Import a library when its source is first used.

    Libraries made with SWIG emit warnings at import, and Harvesters changes the filters of all warnings; both are
    undone here. Raises `MissingExtraError` when it is not installed.
    """
    imported = name in sys.modules
    with contextlib.nullcontext() if imported else quiet_decoders():  # silences warnings, and restores the filters
        return import_extra(name, feature=f"the camera source {source}", extra=f"camera-{source}")


_BUFFER_BYTES = 64 * 2**20
_FEWEST_BUFFERS, _MOST_BUFFERS = 4, 32
_LONGEST_REASON = 160


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grab:
    """One buffer of the camera.

    Parameters
    ----------
    pixels
        Grey levels, shape (rows, columns); None for an incomplete buffer.
    number
        The camera's number; None without one.
    time_s
        Seconds on the camera's own clock; None without one.
    """

    pixels: NDArray[Any] | None
    number: int | None = None
    time_s: float | None = None


class Link(Protocol):
    """The connection to one open camera; it is never used again after its release or loss."""

    @property
    def identity(self) -> str:
        """The camera's name in its source."""

    @property
    def nodes(self) -> Nodes:
        """The camera's features."""

    @property
    def present(self) -> bool:
        """False when the library knows that the camera was removed."""

    @property
    def errors(self) -> tuple[type[Exception], ...]:
        """Exceptions of the library when the camera does not answer."""

    def begin(self) -> None:
        """Start the camera."""

    def grab(self, timeout_s: float) -> Grab | None:
        """The next buffer, or None when none arrived in time."""

    def end(self) -> None:
        """Stop the camera."""

    def close(self) -> None:
        """Release the camera."""


def buffer_count(payload_bytes: float) -> int:
    """Number of buffers for a camera: a second's worth at usual rates, within 64 MiB.

    Examples
    --------
    >>> buffer_count(768 * 492), buffer_count(10_000_000)
    (32, 6)
    """
    return int(min(max(_BUFFER_BYTES // max(payload_bytes, 1.0), _FEWEST_BUFFERS), _MOST_BUFFERS))


def buffers_of(nodes: Nodes) -> int:
    """Number of buffers for the frames of a camera."""
    payload = number_node(nodes, "PayloadSize")
    return buffer_count(0.0 if payload is None else payload.value)


def ticks_per_s(nodes: Nodes) -> float:
    """Frequency of a camera's clock; that of nanoseconds where it states none."""
    frequency = number_node(nodes, "GevTimestampTickFrequency")
    return 1e9 if frequency is None else frequency.value


def reason(error: Exception) -> str:
    r"""The text of a library's error for a message: one line, without its source position, not too long.

    Examples
    --------
    >>> reason(RuntimeError("Node is not writable. : AccessException thrown in node 'Width' (file 'x.h', line 76)"))
    'Node is not writable'
    """
    text = " ".join(str(error).split()).partition(" : ")[0]
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text[:_LONGEST_REASON].rstrip(" .") or type(error).__name__


def cannot_open(name: str, error: Exception, *, busy: bool) -> CameraError:
    """The error of a camera that does not open."""
    if busy:
        why = "is busy: another program, or another part of this one, holds it; close that first"
    else:
        why = "cannot be opened; check its cable and power, and that no other program holds it"
    return CameraError(f"{name} {why} (the driver says: {reason(error)})")


def camera_not_found(source: str, identity: str, others: list[str]) -> CameraError:
    """The error of a camera that did not answer the search."""
    start = f"no {source} camera is called {identity!r}" if identity else f"no {source} camera was found"
    return CameraError(start + (f"; found: {', '.join(others)}" if others else "; check its cable and power"))


_RATES = (
    "ResultingFrameRate",
    "ResultingFrameRateAbs",
    "AcquisitionResultingFrameRate",
    "AcquisitionFrameRate",
    "AcquisitionFrameRateAbs",
)


def modes(nodes: Nodes) -> tuple[Mode, ...]:
    """Each grey format at the present size and at the full one; the present format and size first.

    Only the present size has a rate. Raises `CameraError` when the size is unknown or no grey format is available.
    """
    formats = _grey_formats(nodes)
    width, height = _size(nodes)
    frame_rate = first_number(nodes, _RATES)
    rate = frame_rate[1].value if frame_rate is not None and 1e-3 <= frame_rate[1].value <= 1e5 else None
    full = _full("WidthMax", nodes, width), _full("HeightMax", nodes, height)
    present = (int(width.value), int(height.value))
    sizes = [(*present, rate)] if full == present else [(*present, rate), (*full, None)]
    return tuple(
        Mode(width_px=w, height_px=h, full_scale=FULL_SCALE[name], frames_per_s=fps, pixel_format=name)
        for w, h, fps in sizes
        for name in formats
    )


def apply_mode(nodes: Nodes, mode: Mode) -> None:
    """Set the camera to ``mode``; a size other than the present one becomes a region in the middle of the sensor.

    Raises `CameraError` when the camera does not offer the format or the size; `InputError` when it does not take the
    rate.
    """
    formats = _grey_formats(nodes)
    if mode.pixel_format not in formats or mode.full_scale != FULL_SCALE[mode.pixel_format]:
        offered = ", ".join(f"{name} (full scale {FULL_SCALE[name]:g})" for name in formats)
        raise CameraError(f"the camera has no mode {mode.label} of full scale {mode.full_scale:g}; it offers {offered}")
    pixel_format = choice_node(nodes, "PixelFormat")
    if pixel_format is not None and pixel_format.value != mode.pixel_format:
        nodes.write("PixelFormat", mode.pixel_format)
    width, height = _size(nodes)
    if (width.value, height.value) != (mode.width_px, mode.height_px):
        _resize(nodes, mode)
    rate = first_number(nodes, _RATES)
    if mode.frames_per_s is not None and (rate is None or rate[1].value != mode.frames_per_s):
        adjust(nodes, "frames_per_s", mode.frames_per_s)


def _grey_formats(nodes: Nodes) -> list[str]:
    pixel_format = choice_node(nodes, "PixelFormat") or ChoiceNode(value="", options=())
    grey = [name for name in pixel_format.options if name in FULL_SCALE]
    if not grey:
        offered = ", ".join(pixel_format.options) or "none"
        raise CameraError(f"the camera must offer a grey pixel format ({', '.join(FULL_SCALE)}); it offers {offered}")
    return sorted(grey, key=lambda name: (name != pixel_format.value, FULL_SCALE[name]))


def _size(nodes: Nodes) -> tuple[NumberNode, NumberNode]:
    width, height = number_node(nodes, "Width"), number_node(nodes, "Height")
    if width is None or height is None:
        raise CameraError("the camera does not report the size of its frames")
    return width, height


def _full(name: str, nodes: Nodes, present: NumberNode) -> int:
    sensor = number_node(nodes, name)
    return int(present.high if sensor is None else sensor.value)


def _resize(nodes: Nodes, mode: Mode) -> None:
    for offset in ("OffsetX", "OffsetY"):
        node = number_node(nodes, offset)
        if node is not None and node.value != node.low:
            nodes.write(offset, node.low)  # the offset limits the size
    for name, offset, requested in (("Width", "OffsetX", mode.width_px), ("Height", "OffsetY", mode.height_px)):
        node = number_node(nodes, name)
        if node is None or node.nearest(requested) != requested:
            room = "" if node is None else f"; its {name} goes from {node.low:g} to {node.high:g} by {node.step:g}"
            raise CameraError(f"the camera has no mode {mode.label}{room}")
        nodes.write(name, requested)
        first = number_node(nodes, offset)
        if first is not None and first.high > first.low:
            nodes.write(offset, first.nearest((first.low + first.high) / 2))


_POLL_S = 0.1  # longest wait for a frame, so the delay of a stop or a removal

# some libraries open a camera twice in one process, and the two connections disturb each other
_open_identities: set[str] = set()
_open_identities_lock = threading.Lock()


class GenICamCamera:
    """A camera behind a `Link`.

    Frames carry the camera's number and time: a lost or incomplete frame is a gap in `sequence` and is never
    delivered. Starting switches off triggers and automatic exposure, gain and black level. A frame carries the
    settings at its arrival; after `adjust`, frames already on their way differ.

    Parameters
    ----------
    source
        Name of the source, for messages.
    identity
        Of the camera; the first camera when empty.
    link
        Opens the camera and returns the connection.
    clock
        Seconds, monotonic; detects silence, and gives the time of frames without one.
    """

    def __init__(
        self, source: str, identity: str, *, link: Callable[[], Link], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._name = f"{source} camera {identity}".rstrip()
        self._source, self._connect, self._clock = source, link, clock
        self._link: Link | None = None
        self._buffers = ""
        self._running = threading.Event()
        self._lost = False
        self._values: dict[str, float] = {}
        self._full_scale = 255.0
        self._looking, self._features = threading.Lock(), threading.Lock()

    @property
    def name(self) -> str:
        """Display name."""
        return self._name

    @property
    def lost(self) -> bool:
        """True when the camera was silent or removed while it was running."""
        return self._lost

    def open(self) -> None:
        """Connect to the camera with a new handle.

        Raises `CameraError` when it does not answer, or is in use by another program or by this one;
        `MissingExtraError` when its library is not installed.
        """
        self.stop()
        link = self._connect()
        name = f"{self._source} camera {link.identity}"
        with _open_identities_lock:
            taken = name in _open_identities
            _open_identities.add(name)
        if taken:
            with contextlib.suppress(*link.errors):
                link.close()
            raise CameraError(f"{name} is busy: this program holds it already; stop() that camera first")
        self._link, self._name, self._buffers, self._lost = link, name, name, False

    def modes(self) -> tuple[Mode, ...]:
        """Each grey format at the present size and at the full one, the present one first."""
        with self._speaking("tell its modes") as link:
            return modes(link.nodes)

    def settings(self) -> tuple[Setting, ...]:
        """The available settings of exposure_ms, gain, brightness and frames_per_s."""
        with self._speaking("tell its settings") as link:
            return settings(link.nodes)

    def adjust(self, name: str, value: float) -> None:
        """Change one of `settings`, running or not, and switch off its automatic control."""
        with self._speaking(f"take {name} = {value}") as link:
            adjust(link.nodes, name, value)
            self._remember(link)

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames in ``mode``, or in the first of `modes`.

        A mode of another size becomes a region in the middle, where the camera supports it.
        """
        with self._speaking("start") as link:
            if self._running.is_set():
                raise CameraError(f"{self.name} is running already; call stop() and open() first")
            run_free(link.nodes)
            chosen = mode or modes(link.nodes)[0]
            apply_mode(link.nodes, chosen)
            self._full_scale = chosen.full_scale
            self._remember(link)
            link.begin()
            self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Yield frames on arrival, until stopped.

        Raises `CameraError` when none arrives for 1 s (or three frames, where those take longer) or the camera is
        removed.
        """
        if not self._running.is_set():
            raise CameraError(f"{self.name} must be started before frames are read; call start()")
        count, first_s, own_clock = BlockCount(), None, True
        awake = AwakeClock(self._clock)
        silent_since_s = awake()
        while (link := self._link) is not None and self._running.is_set():
            grab = self._look(link)
            now_s, awake_s = self._clock(), awake()
            if grab is None:
                if self._running.is_set() and awake_s - silent_since_s >= silence_timeout_s(self._values):
                    raise self._loss(f"no frame came for {awake_s - silent_since_s:.1f} s")
                continue
            silent_since_s = awake_s
            if grab.pixels is None:
                if grab.number is not None:
                    count.at(grab.number)
                continue
            if first_s is None:
                own_clock = grab.time_s is not None
            stamp_s = grab.time_s if own_clock and grab.time_s is not None else now_s
            first_s = stamp_s if first_s is None else first_s
            sequence = count.at(grab.number)
            yield Frame(
                pixels=grab.pixels,
                sequence=sequence,
                time_s=stamp_s - first_s,
                full_scale=self._full_scale,
                name=f"{self.name}#{sequence}",
                settings=self._values,
            )
            silent_since_s = awake()  # a slow reader is not a silent camera

    def stop(self) -> None:
        """End the stream and release the camera; a thread that waits in `frames` returns at once."""
        self._running.clear()
        with self._looking, self._features:  # no other thread uses the camera meanwhile
            link, self._link = self._link, None
            name, self._buffers = self._buffers, ""
        if link is None:
            return
        try:
            for step in (link.end, link.close):
                with contextlib.suppress(*link.errors):  # a lost camera cannot be stopped
                    step()
        finally:
            with _open_identities_lock:
                _open_identities.discard(name)

    def _look(self, link: Link) -> Grab | None:
        """One attempt to get a frame; the camera counts as lost when it was removed."""
        try:
            with self._looking:
                if self._link is not link:
                    return None
                present = link.present
                grab = link.grab(_POLL_S) if present else None
        except link.errors as error:
            if not self._running.is_set():
                return None
            raise self._loss(f"reading it failed: {reason(error)}") from error
        if not present and self._running.is_set():
            raise self._loss("it was removed")
        return grab

    def _loss(self, why: str) -> CameraError:
        self._lost = True
        self._running.clear()
        return CameraError(f"{self.name} was lost: {why}; check its cable and power, and open it again")

    def _remember(self, link: Link) -> None:
        self._values = {setting.name: setting.value for setting in settings(link.nodes)}

    @contextlib.contextmanager
    def _speaking(self, what: str) -> Iterator[Link]:
        """Lock the camera's features for one call, and convert its library's errors."""
        with self._features:
            if self._link is None:
                raise CameraError(f"{self.name} must be opened first; call open()")
            try:
                yield self._link
            except self._link.errors as error:
                raise CameraError(f"{self.name} does not {what}: {reason(error)}") from error
