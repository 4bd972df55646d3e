"""Cameras of the GenICam standard, and their modes: grey pixel formats, region, rate."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import TYPE_CHECKING

from tsis.errors import CameraError
from tsis.instrument._camera import Frame, Mode, silence_timeout_s
from tsis.instrument.drivers._frame_numbers import FULL_SCALE, BlockCount
from tsis.instrument.drivers.genicam import _settings as genicam_settings
from tsis.instrument.drivers.genicam._link import reason
from tsis.instrument.drivers.genicam._settings import ChoiceNode, adjust, choice_node, first_number, number_node

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.instrument._camera import Setting
    from tsis.instrument.drivers.genicam._link import Grab, Link
    from tsis.instrument.drivers.genicam._settings import Nodes, NumberNode


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
        position = number_node(nodes, offset)
        if position is not None and position.high > position.low:
            nodes.write(offset, position.nearest((position.low + position.high) / 2))


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
            return genicam_settings.settings(link.nodes)

    def adjust(self, name: str, value: float) -> None:
        """Change one of `settings`, running or not, and switch off its automatic control."""
        with self._speaking(f"take {name} = {value}") as link:
            genicam_settings.adjust(link.nodes, name, value)
            self._remember(link)

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames in ``mode``, or in the first of `modes`.

        A mode of another size becomes a region in the middle, where the camera supports it.
        """
        with self._speaking("start") as link:
            if self._running.is_set():
                raise CameraError(f"{self.name} is running already; call stop() and open() first")
            genicam_settings.run_free(link.nodes)
            chosen = mode or modes(link.nodes)[0]
            apply_mode(link.nodes, chosen)
            self._full_scale = chosen.full_scale
            self._remember(link)
            link.begin()
            self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Yield frames on arrival, until stopped.

        Raises `CameraError` when none arrives for 1 s (or two frames, where those take longer) or the camera is
        removed.
        """
        if not self._running.is_set():
            raise CameraError(f"{self.name} must be started before frames are read; call start()")
        count, first_s, own_clock = BlockCount(), None, True
        silent_since_s = self._clock()
        while (link := self._link) is not None and self._running.is_set():
            grab = self._check_connection(link, silent_since_s)
            now_s = self._clock()
            if grab is None:
                continue
            silent_since_s = now_s
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
            silent_since_s = self._clock()  # a slow reader is not a silent camera

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

    def _check_connection(self, link: Link, silent_since_s: float) -> Grab | None:
        """One attempt to get a frame; the camera counts as lost when it was removed or silent too long."""
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
        if grab is None and self._running.is_set():
            if not present:
                raise self._loss("it was removed")
            silent_s = self._clock() - silent_since_s
            if silent_s >= silence_timeout_s(self._values):
                raise self._loss(f"no frame came for {silent_s:.1f} s")
        return grab

    def _loss(self, why: str) -> CameraError:
        self._lost = True
        self._running.clear()
        return CameraError(f"{self.name} was lost: {why}; check its cable and power, and open it again")

    def _remember(self, link: Link) -> None:
        self._values = {setting.name: setting.value for setting in genicam_settings.settings(link.nodes)}

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
