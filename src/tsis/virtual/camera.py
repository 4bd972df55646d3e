"""The virtual probe behind the camera protocol: a stream of frames of a press that is held."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.imaging.sensor import expose
from tsis.instrument import Frame, Mode, Setting
from tsis.model import check
from tsis.model.errors import CameraError, InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from tsis.model import Phantom
    from tsis.virtual.probe import VirtualProbe

LARGEST_FORCE_N = 5.0
USUAL_MS = 20.0  # exposure under which the light is that of the probe's calibration


class VirtualCamera:
    """A camera that looks at a virtual probe while it is held on a phantom.

    Its settings are the force of the press (0 for no contact) and those of a camera: ``exposure_ms``, to which light
    is proportional, ``gain`` in decibels, which amplifies light and noise alike, and ``brightness``, the black level.
    At 20 ms, 0 dB and the sensor's own black level it sees what `VirtualProbe` sees.

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
        Rate, in [0.1, 1000].
    paced
        Whether a frame comes when a camera of that rate would bring it, or else as soon as it is asked for.
    clock
        Seconds, monotonic.

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
        paced: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._probe, self._phantom, self._rng = probe, phantom, rng
        rate = check.number("frames_per_s", frames_per_s, 0.1, 1000.0)
        self._paced, self._clock = paced, clock
        self._settings = {
            one.name: one
            for one in (
                Setting(name="force_n", value=force_n, low=0.0, high=LARGEST_FORCE_N, unit="newtons"),
                Setting(name="exposure_ms", value=min(USUAL_MS, 1000 / rate), low=0.01, high=1000 / rate, unit="ms"),
                Setting(name="gain", value=0.0, low=0.0, high=24.0, unit="dB"),
                Setting(
                    name="brightness",
                    value=probe.sensor.background_grey,
                    low=0.0,
                    high=0.25 * probe.sensor.full_scale,
                    unit="grey levels",
                ),
            )
        }
        check.number("force_n", force_n, 0.0, LARGEST_FORCE_N, hint="newtons")
        self._mode = Mode(
            width_px=probe.sensor.columns,
            height_px=probe.sensor.rows,
            full_scale=probe.sensor.full_scale,
            frames_per_s=rate,
        )
        self._opened = False
        self._running, self._stopped = threading.Event(), threading.Event()

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
        """The force of the press, and the camera's exposure, gain and black level."""
        return tuple(self._settings.values())

    def adjust(self, name: str, value: float) -> None:
        """Change a setting; the next frame shows it."""
        setting = self._settings[check.known("setting", name, self._settings)]
        self._settings[name] = replace(setting, value=setting.checked(value))

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames."""
        if not self._opened:
            raise CameraError(f"{self.name} must be opened first; call open()")
        if mode not in (None, self._mode):
            raise InputError(f"mode must be {self._mode}; got {mode}")
        self._stopped.clear()
        self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Yield frames of the press as it is held, until stopped."""
        if not self._running.is_set():
            raise CameraError(f"{self.name} must be started before frames are read; call start()")
        sequence, held, light = 0, None, None
        period_s, begun_s = 1 / (self._mode.frames_per_s or 1.0), self._clock()
        due_s = begun_s
        while self._running.is_set():
            values = {name: setting.value for name, setting in self._settings.items()}
            if light is None or held != values["force_n"]:
                held = values["force_n"]
                light = self._probe.light(self._phantom, force_n=held)
            if self._paced:
                due_s = max(due_s, self._clock())  # a frame that took long to make delays those after it
                if self._stopped.wait(due_s - self._clock()):
                    return
            begun_s = due_s if sequence == 0 else begun_s
            yield Frame(
                pixels=self._exposed(light, values),
                sequence=sequence,
                time_s=due_s - begun_s,
                full_scale=self._mode.full_scale,
                name=f"{self.name}#{sequence}",
                settings={"source": "virtual", **values},
            )
            sequence += 1
            due_s += period_s

    def _exposed(self, light: NDArray[np.float64], values: dict[str, float]) -> NDArray[Any]:
        sensor = self._probe.sensor
        amplified = 10 ** (values["gain"] / 20)
        seen = replace(
            sensor,
            background_grey=values["brightness"],
            read_noise_grey=min(amplified * sensor.read_noise_grey, sensor.full_scale),
            shot_noise_grey=min(amplified * sensor.shot_noise_grey, sensor.full_scale),
        )
        grey = expose(light * (amplified * values["exposure_ms"] / USUAL_MS), seen, self._rng)
        return grey.astype(np.uint8 if sensor.full_scale <= 255 else np.uint16)

    def stop(self) -> None:
        """End the stream."""
        self._running.clear()
        self._stopped.set()
        self._opened = False
