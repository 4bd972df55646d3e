"""The virtual probe behind the camera protocol: a stream of frames of a press that is held."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from tsis.imaging.sensor import expose
from tsis.instrument import Frame, Mode, Setting
from tsis.model import check
from tsis.model.errors import CameraError, InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np

    from tsis.model import Phantom
    from tsis.virtual.probe import VirtualProbe

LARGEST_FORCE_N = 5.0


class VirtualCamera:
    """A camera that looks at a virtual probe while it is held on a phantom.

    Frames come as fast as they are asked for; their times are those of a camera of ``frames_per_s``. The one setting is
    the force of the press, 0 for no contact.

    Parameters
    ----------
    probe
        The virtual probe.
    phantom
        What it is held on.
    rng
        Source of the frames' noise.
    force_n
        Force at the start, in newtons.
    frames_per_s
        Nominal rate.

    Examples
    --------
    >>> import numpy, tsis
    >>> rng = numpy.random.default_rng(1)
    >>> probe = tsis.virtual.VirtualProbe(tsis.load_probe("tsis-2011"), rng=rng)
    >>> camera = VirtualCamera(probe, tsis.load_phantom("plain"), rng=rng)
    >>> camera.open()
    >>> camera.start()
    >>> next(camera.frames()).pixels.shape
    (492, 768)
    >>> camera.stop()
    """

    def __init__(
        self,
        probe: VirtualProbe,
        phantom: Phantom,
        *,
        rng: np.random.Generator,
        force_n: float = 1.0,
        frames_per_s: float = 30.0,
    ) -> None:
        self._probe, self._phantom, self._rng = probe, phantom, rng
        self._force_n = check.number("force_n", force_n, 0.0, LARGEST_FORCE_N, hint="newtons")
        self._mode = Mode(
            width_px=probe.sensor.columns,
            height_px=probe.sensor.rows,
            full_scale=probe.sensor.full_scale,
            frames_per_s=frames_per_s,
        )
        self._opened = False
        self._running = threading.Event()

    @property
    def name(self) -> str:
        """What a person calls it."""
        return f"virtual probe on {self._phantom.name or 'a phantom'}"

    @property
    def lost(self) -> bool:
        """Never: nothing can be unplugged."""
        return False

    def open(self) -> None:
        """Take hold of it."""
        self._opened = True

    def modes(self) -> tuple[Mode, ...]:
        """The sensor's one mode."""
        return (self._mode,)

    def settings(self) -> tuple[Setting, ...]:
        """The force of the press."""
        return (Setting(name="force_n", value=self._force_n, low=0.0, high=LARGEST_FORCE_N, unit="newtons"),)

    def adjust(self, name: str, value: float) -> None:
        """Change the force; the next frame shows it."""
        (force,) = self.settings()
        check.known("setting", name, [force.name])
        self._force_n = force.checked(value)

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames."""
        if not self._opened:
            raise CameraError(f"{self.name} must be opened first; call open()")
        if mode not in (None, self._mode):
            raise InputError(f"mode must be {self._mode}; got {mode}")
        self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Yield frames of the press as it is held, until stopped."""
        if not self._running.is_set():
            raise CameraError(f"{self.name} must be started before frames are read; call start()")
        sequence, held, light = 0, None, None
        while self._running.is_set():
            if light is None or held != self._force_n:
                held = self._force_n
                light = self._probe.light(self._phantom, force_n=held)
            yield Frame(
                pixels=expose(light, self._probe.sensor, self._rng),
                sequence=sequence,
                time_s=sequence / (self._mode.frames_per_s or 1.0),
                full_scale=self._mode.full_scale,
                name=f"{self.name}#{sequence}",
                settings={"source": "virtual", "force_n": held},
            )
            sequence += 1

    def stop(self) -> None:
        """End the stream."""
        self._running.clear()
        self._opened = False
