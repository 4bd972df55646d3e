"""A virtual rig or gel sensor behind the camera protocol."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from tsis.catalog.sensors import list_sensors
from tsis.errors import CameraError, InputError
from tsis.imaging.sensor import Sensor, expose
from tsis.instrument.camera import Frame, Mode, Setting
from tsis.instrument.image_files import luma
from tsis.model.gel_sensor import GelSensor
from tsis.model.require import require_number, require_one_of, require_type
from tsis.virtual.gel_frames import rendered_series

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from multiprocessing.connection import Connection
    from multiprocessing.context import SpawnProcess

    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom, SoftSphere
    from tsis.virtual.gel_frames import RenderedPress


def exposed(light: NDArray[np.float64], factor: float, sensor: Sensor, rng: np.random.Generator) -> NDArray[Any]:
    """Pixels of a frame of ``factor`` times a light, shape (rows, columns), uint8 or uint16; the rest as `expose`."""
    return expose(light * factor, sensor, rng).astype(_type_of(sensor))


def load_exposure() -> None:
    """Load what exposes frames, which takes half a second before the first one else."""
    exposed(np.zeros((8, 8)), 1.0, Sensor(rows=8, columns=8), np.random.default_rng(0))


FIRST_HERE = 15  # frames; the first picture does not share the processor with the start of a process


class ExposingProcess:
    """Exposes frames in a process of its own, with a generator spawned from ``rng``.

    The process begins after `FIRST_HERE` frames. Frames are exposed here until it is ready, and again if it was killed.
    It ends with `close`, or with this program. One thread at a time.
    """

    # A bare pipe: the queues and threads of an executor take twice the processor time in the program that shows frames.

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._light: NDArray[np.float64] | None = None  # which the process has
        self._process: SpawnProcess | None = None
        self._there: Connection | None = None
        self._apart, self._here = False, 0

    @property
    def pid(self) -> int | None:
        """Number of the process that exposes; None while frames are exposed here."""
        return self._process.pid if self._process is not None and self._apart else None

    def expose(self, light: NDArray[np.float64], factor: float, sensor: Sensor) -> NDArray[Any]:
        """Pixels as `exposed`; a light is taken to be unchanged while it is the same array."""
        try:
            if (there := self._ready()) is not None:
                there.send((None if light is self._light else light, factor, sensor))
                self._light = light
                return np.frombuffer(there.recv_bytes(), dtype=_type_of(sensor)).reshape(light.shape)
        except (EOFError, OSError):  # it was killed
            self.close()
        self._here += 1
        if self._here == FIRST_HERE:
            self._begin()
        return exposed(light, factor, sensor, self._rng)

    def close(self) -> None:
        """End the process; another call does nothing."""
        self._apart = False
        if self._there is not None:
            self._there.close()
        if self._process is not None:
            self._process.kill()  # it may still be loading, and has nothing to save
            self._process.join()

    def _begin(self) -> None:
        context = get_context("spawn")
        self._there, end = context.Pipe()
        self._process = context.Process(target=_serve, args=(end,), name="exposing", daemon=True)
        self._process.start()
        end.close()

    def _ready(self) -> Connection | None:
        """The connection to the process, once that is ready."""
        there = self._there
        if there is None or there.closed:
            return None
        if not self._apart and there.poll():
            there.recv()
            there.send(self._rng.spawn(1)[0])
            self._apart = True
        return there if self._apart else None


def _type_of(sensor: Sensor) -> type[np.uint8 | np.uint16]:
    return np.uint8 if sensor.full_scale <= np.iinfo(np.uint8).max else np.uint16


def _serve(requests: Connection) -> None:
    """Answer requests until the other end is closed; it alone is interrupted at a terminal."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(2, 1)  # standard output is for the other program's messages
    load_exposure()
    light = np.zeros((8, 8))
    try:
        requests.send(None)
        rng = requests.recv()
        while True:
            changed, factor, sensor = requests.recv()
            light = light if changed is None else changed
            requests.send_bytes(exposed(light, factor, sensor, rng).tobytes())
    except (EOFError, OSError):  # closed
        return


LARGEST_FORCE_N = 5.0
FORCE_SETTING = "force_n"  # a setting of the virtual camera only
USUAL_PER_S = 30.0
USUAL_MS = 20.0  # exposure of the probe's calibration


class VirtualScene(Protocol):
    """The scene of a virtual camera: a `VirtualProbe` on tissue, or a `DirectContactRig` on objects."""

    @property
    def sensor(self) -> Sensor:
        """Pixels and noise."""

    @property
    def frame_settings(self) -> Mapping[str, str]:
        """Origin of its frames."""

    def light(self, pressed: Any, /, *, force_n: float) -> NDArray[np.float64]:
        """Expected grey levels above the background, shape (rows, columns)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Press:
    """The current press, replaced as a whole: no frame combines one press with the force of another."""

    target: Phantom | SoftSphere
    force: Setting
    light: NDArray[np.float64] | None


class VirtualCamera:
    """The camera of a virtual probe on a phantom or an object.

    Its settings are the force of the press (0 for no contact), ``exposure_ms``, to which light is proportional,
    ``gain`` in decibels, which amplifies light and noise equally, and ``brightness``, the black level. At 20 ms, 0 dB
    and the sensor's own black level its frames are those of `VirtualProbe`.

    Parameters
    ----------
    probe
        The virtual probe.
    phantom
        Phantom or object under the probe.
    rng
        Random generator of the frames' noise.
    force_n
        Initial force, in newtons.
    frames_per_s
        Rate, in [0.1, 1000].
    paced
        Whether frames arrive at that rate, or on request without delay.
    clock
        Seconds, monotonic.
    light
        Expected grey levels above the background of the initial press, shape (rows, columns). None computes them for
        the first frame, which takes tenths of a second on tissue and seconds on a sphere.
    apart
        Whether frames are exposed in a process of their own, begun with each stream.

    Examples
    --------
    >>> import numpy, tsis
    >>> rng = numpy.random.default_rng(1)
    >>> probe = tsis.virtual.VirtualProbe(tsis.load_probe("tsis-2011"), rng=rng, strain="small")
    >>> camera = VirtualCamera(probe, tsis.load_phantom("plain"), rng=rng)
    >>> camera.open()
    >>> camera.start()
    >>> next(camera.frames()).pixels.shape
    (492, 768)
    >>> camera.stop()
    """

    def __init__(
        self,
        probe: VirtualScene,
        phantom: Phantom | SoftSphere,
        *,
        rng: np.random.Generator,
        force_n: float = 1.0,
        frames_per_s: float = USUAL_PER_S,
        paced: bool = False,
        clock: Callable[[], float] = time.monotonic,
        light: NDArray[np.float64] | None = None,
        apart: bool = False,
    ) -> None:
        self._probe, self._rng, self._apart = probe, rng, apart
        rate = require_number("frames_per_s", frames_per_s, 0.1, 1000.0)
        self._paced, self._clock = paced, clock
        self._settings = {
            item.name: item
            for item in (
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
        force = Setting(name=FORCE_SETTING, value=force_n, low=0.0, high=LARGEST_FORCE_N, unit="newtons")
        force.checked(force_n)
        shape = (probe.sensor.rows, probe.sensor.columns)
        if light is not None and np.shape(light) != shape:
            raise InputError(f"light must have the sensor's shape, {shape}; got {np.shape(light)}")
        self._press = _Press(target=phantom, force=force, light=light)
        self._pressing = threading.Lock()
        self._mode = virtual_mode(probe.sensor, rate)
        self._opened = False
        self._running, self._stopped = threading.Event(), threading.Event()

    @property
    def name(self) -> str:
        """Name for users."""
        return _name_of(self._press)

    lost = False  # a virtual camera cannot be unplugged

    def open(self) -> None:
        """Open the camera."""
        self._opened = True

    def modes(self) -> tuple[Mode, ...]:
        """The sensor's one mode."""
        return (self._mode,)

    def settings(self) -> tuple[Setting, ...]:
        """The force of the press, and the camera's exposure, gain and black level."""
        return (self._press.force, *self._settings.values())

    def adjust(self, name: str, value: float) -> None:
        """Change a setting, effective from the next frame.

        Raises
        ------
        UnknownNameError, InputError
            When there is no such setting, or the value lies outside its range.
        MechanicsError
            When the force is too large for the tissue; the press does not change.
        """
        require_one_of("setting", name, (FORCE_SETTING, *self._settings))
        if name != FORCE_SETTING:
            setting = self._settings[name]
            self._settings[name] = replace(setting, value=setting.checked(value))
            return
        with self._pressing:
            press = self._press
            force = replace(press.force, value=press.force.checked(value))
            light = press.light
            if light is not None and force.value != press.force.value:
                light = self._probe.light(press.target, force_n=force.value)
            self._press = replace(press, force=force, light=light)

    def hold_on(
        self, phantom: Phantom | SoftSphere, *, force_n: float, light: NDArray[np.float64] | None = None
    ) -> None:
        """Lift the probe and press again, on the same or another target; errors as `adjust`.

        Meanwhile frames show the old press. ``light`` is the light of the new press, computed when None.
        """
        with self._pressing:
            force = replace(self._press.force, value=self._press.force.checked(force_n))
            light = self._probe.light(phantom, force_n=force.value) if light is None else light
            self._press = _Press(target=phantom, force=force, light=light)

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames."""
        if not self._opened:
            raise CameraError(f"{self.name} must be opened first; call open()")
        if mode not in (None, self._mode):
            raise InputError(f"mode must be {self._mode}; got {mode}")
        self._stopped.clear()
        self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Yield frames of the current press, until stopped."""
        if not self._running.is_set():
            raise CameraError(f"{self.name} must be started before frames are read; call start()")
        with self._exposing() as expose:
            yield from self._frames(expose)

    def _frames(self, expose: Callable[[NDArray[np.float64], float, Sensor], NDArray[Any]]) -> Iterator[Frame]:
        sequence = 0
        period_s, start_s = 1 / (self._mode.frames_per_s or 1.0), self._clock()
        due_s = start_s
        while self._running.is_set():
            if self._paced:
                due_s = max(due_s, self._clock() - period_s)  # a frame later than a period delays the others
                if self._stopped.wait(due_s - self._clock()):
                    return
            press, light = self._lit()
            values = {FORCE_SETTING: press.force.value}
            values |= {name: setting.value for name, setting in self._settings.items()}
            gain = 10 ** (values["gain"] / 20)
            sensor = self._amplified(gain, values["brightness"])
            start_s = due_s if sequence == 0 else start_s
            yield Frame(
                pixels=expose(light, gain * values["exposure_ms"] / USUAL_MS, sensor),
                sequence=sequence,
                time_s=due_s - start_s,
                full_scale=self._mode.full_scale,
                name=f"{_name_of(press)}#{sequence}",
                settings={**self._probe.frame_settings, **values},
            )
            sequence += 1
            due_s += period_s

    @contextmanager
    def _exposing(self) -> Iterator[Callable[[NDArray[np.float64], float, Sensor], NDArray[Any]]]:
        """Exposes frames of a light, a factor and a sensor."""
        if not self._apart:
            yield partial(exposed, rng=self._rng)
            return
        with closing(ExposingProcess(self._rng)) as process:
            yield process.expose

    def _lit(self) -> tuple[_Press, NDArray[np.float64]]:
        """The press and its light, computed on first use."""
        press = self._press
        if press.light is None:
            with self._pressing:
                press = self._press
                if press.light is None:
                    light = self._probe.light(press.target, force_n=press.force.value)
                    self._press = press = replace(press, light=light)
        assert press.light is not None
        return press, press.light

    def _amplified(self, gain: float, black_grey: float) -> Sensor:
        """The sensor whose noise is amplified, with a black level."""
        sensor = self._probe.sensor
        return replace(
            sensor,
            background_grey=black_grey,
            read_noise_grey=min(gain * sensor.read_noise_grey, sensor.full_scale),
            shot_noise_grey=min(gain * sensor.shot_noise_grey, sensor.full_scale),
        )

    def stop(self) -> None:
        """End the stream."""
        self._running.clear()
        self._stopped.set()
        self._opened = False


VIRTUAL_GEL = "virtual-gel"
GEL_PRESS_SETTING = "press"  # of the virtual gel sensor: 0 is untouched
GEL_PRESSES, GEL_BALL_MM, GEL_PER_S = 6, 6.0, 10.0


def virtual_gel_sensor(spec: str) -> str:
    """Name of the sensor in ``virtual-gel:SENSOR``, of the catalog; empty for another camera.

    Raises `UnknownNameError` when the catalog has no such sensor.

    Examples
    --------
    >>> virtual_gel_sensor("virtual-gel:digit"), virtual_gel_sensor("opencv:0")
    ('digit', '')
    """
    source, _, name = spec.partition(":")
    return require_one_of("sensor", name, list_sensors()) if source == VIRTUAL_GEL else ""


class VirtualGelCamera:
    """The camera of a virtual gel sensor in colour: a ball pressed at one of some places, or the untouched sensor.

    Its setting ``press`` chooses: 0 is the untouched sensor, where it begins. Frames are those of `rendered_series`
    with the same seed, as ``tsis sensor frames`` writes them, so that a depth calibration of those holds here.

    Parameters
    ----------
    sensor
        A sensor with a known scale.
    seed
        Of lamps, places, depths and noise.
    per_s
        Frames a second.
    """

    def __init__(self, sensor: GelSensor, *, seed: int = 1, per_s: float = GEL_PER_S) -> None:
        require_type("sensor", sensor, GelSensor)
        self._sensor, self._seed = sensor, seed
        self._press = Setting(name=GEL_PRESS_SETTING, value=0.0, low=0.0, high=float(GEL_PRESSES))
        columns, rows = sensor.image_px
        self._mode = Mode(width_px=columns, height_px=rows, frames_per_s=per_s, pixel_format="RGB8")
        self._made: list[RenderedPress] = []
        self._running, self._stopped = threading.Event(), threading.Event()

    @property
    def name(self) -> str:
        """Display name."""
        return f"virtual {self._sensor.name}"

    lost = False  # a virtual camera cannot be unplugged

    def open(self) -> None:
        """Render the presses, once."""
        if not self._made:
            self._made = rendered_series(self._sensor, GEL_PRESSES, ball_radius_mm=GEL_BALL_MM / 2, seed=self._seed)

    def modes(self) -> tuple[Mode, ...]:
        """The sensor's one mode."""
        return (self._mode,)

    def settings(self) -> tuple[Setting, ...]:
        """The press."""
        return (self._press,)

    def adjust(self, name: str, value: float) -> None:
        """Choose a press from the next frame on; `UnknownNameError` or `InputError` for another name or value."""
        require_one_of("setting", name, (GEL_PRESS_SETTING,))
        self._press = replace(self._press, value=float(round(self._press.checked(value))))

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames."""
        if not self._made:
            raise CameraError(f"{self.name} must be opened first; call open()")
        if mode not in (None, self._mode):
            raise InputError(f"mode must be {self._mode}; got {mode}")
        self._stopped.clear()
        self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Yield frames at their rate, until stopped."""
        if not self._running.is_set():
            raise CameraError(f"{self.name} must be started before frames are read; call start()")
        start_s, sequence = time.monotonic(), 0
        while self._running.is_set():
            number = int(self._press.value)
            colour = self._made[number - 1].frame if number else self._made[0].reference
            yield Frame(
                pixels=np.rint(luma(colour)).astype(np.uint8),
                colour=colour,
                sequence=sequence,
                time_s=time.monotonic() - start_s,
                name=f"{self.name}#{sequence}",
                settings={GEL_PRESS_SETTING: self._press.value, "source": "virtual gel sensor"},
            )
            sequence += 1
            if self._stopped.wait(1.0 / (self._mode.frames_per_s or GEL_PER_S)):
                return

    def stop(self) -> None:
        """End the stream."""
        self._running.clear()
        self._stopped.set()


def camera_settings(sensor: Sensor, *, exposure: float = 1.0) -> dict[str, float]:
    """Settings of a virtual probe's camera at ``exposure`` times the usual one."""
    return {"exposure_ms": exposure * USUAL_MS, "gain": 0.0, "brightness": sensor.background_grey}


def virtual_mode(sensor: Sensor, frames_per_s: float = USUAL_PER_S) -> Mode:
    """The only mode of a virtual camera with that sensor."""
    return Mode(width_px=sensor.columns, height_px=sensor.rows, full_scale=sensor.full_scale, frames_per_s=frames_per_s)


def _name_of(press: _Press) -> str:
    return f"virtual probe on {press.target.name or 'a phantom'}"
