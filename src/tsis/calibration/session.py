"""A calibration session: its steps, their frames, and the calibration."""

from __future__ import annotations

import csv
import io
import math
import secrets
import shutil
from collections.abc import Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import CALIBRATION_FILE, RESEARCH_USE_ONLY, VALID_DAYS
from tsis.calibration.camera_reference import make_reference
from tsis.calibration.dents import LEAST_PAD_N, PAD_THICKNESS_MM, PadPresses, fit_dent_light, ring_edges_mm
from tsis.calibration.dot_board import scale_from_dots
from tsis.calibration.file import (
    SETTING_TOLERANCE,
    ProbeCalibration,
    calibration_bytes,
    calibration_sha256,
    read_calibration,
    require_name,
    require_time,
)
from tsis.calibration.force_line import (
    LARGEST_N,
    STEP_N,
    TIPS_MM,
    UNTOUCHED_N,
    Loading,
    fit_force_line,
    fit_run,
    read_loading_frame,
    total_grey,
)
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.response import fit_response
from tsis.calibration.specification import edge_width, frame_rate, specification_sheet
from tsis.catalog.probes import load_probe
from tsis.compiled import one_blas_thread
from tsis.errors import CalibrationError, CameraError, FileInputError, ImageMismatchError, InputError, TsisError
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import json_bytes
from tsis.files.json_values import from_json_value, to_json_value
from tsis.files.reading import as_path, one_line, printable_path, read_bytes, read_object
from tsis.imaging.profile import radial_profile
from tsis.instrument.image_files import png_bytes, read_image
from tsis.model.content import ContentValue
from tsis.model.image import TactileImage
from tsis.model.require import require_integer, require_number, require_type

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.calibration.camera_reference import CameraReference
    from tsis.calibration.dents import DentLight
    from tsis.calibration.dot_board import DotDiagnostics
    from tsis.calibration.force_line import ForceLine, ForceLineDiagnostics
    from tsis.calibration.response import PressureResponse
    from tsis.calibration.scale import PixelScale
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame
    from tsis.instrument.force_log import ForceLog
    from tsis.model.calibration import Calibration


DARK, UNTOUCHED, FLAT, BOARD_UNTOUCHED, BOARD, EDGE = "dark", "untouched", "flat", "board-untouched", "board", "edge"
STILL_FRAMES, FLAT_FRAMES, BOARD_FRAMES, EDGE_FRAMES = 16, 8, 4, 4
FLAT_LEVELS = 3
PAD, PAD_FORCES_N = "pad", (0.0, 0.4, 0.6, 0.8, 1.0, 1.2)  # of a virtual loading; a person loads about so
STATED = (  # by a person
    "name", "pitch_mm", "pitch_sd_mm", "gauge_share", "patch_px", "tips_mm", "repeats", "pads_kpa", "pad_sd",
)  # fmt: skip
FORMAT, VERSION = "tsis-calibration-session", 1
SETUP_FILE, INDEX = "session.json", "shots.csv"
LARGEST_SETUP_BYTES, LARGEST_INDEX_BYTES, MOST_LINES = 2**20, 8 * 2**20, 100_000
COLUMNS = ("file", "time_s", "force_n", "full_scale")  # the last because a file of 16 bits may contain fewer
SHORT = 12  # characters of an identity in file names
TIMEOUT_S = 5.0
FORCE_S = 1.0  # longest wait for the reading after a frame
TOUCHED_N = 0.03  # above the zero: smaller forces are within the drift of an unloaded gauge
AT_REST = 0.02  # fraction of the largest sum of grey levels that a frame without contact may show
FEWEST_SEEN = 3  # presses on pads that compare the force line with the gauge
LEAST_CORRELATION = 0.97  # of sums and forces; loops of 10 % and curves as F**(2/3) have 0.99


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationStep:
    """One step of a calibration.

    Parameters
    ----------
    name
        Folder of its frames.
    instruction
        Instruction for the person.
    frames
        Number of frames; 0 for a loading, which takes frames until it is over.
    optional
        Whether a calibration is possible without it.
    tip_mm
        Radius of the tip of a loading, mm.
    run
        Number of the loading among those of its tip, from 1.
    pad_kpa
        Modulus of the soft flat pad of a loading, kPa.
    """

    name: str
    instruction: str
    frames: int = 0
    optional: bool = False
    tip_mm: float | None = None
    run: int = 1
    pad_kpa: float | None = None

    @property
    def is_loading(self) -> bool:
        """Whether its frames have forces."""
        return self.tip_mm is not None or self.pad_kpa is not None


def plan_steps(
    tips_mm: Sequence[float] = TIPS_MM, *, repeats: int = 1, pads_kpa: Sequence[float] = ()
) -> tuple[CalibrationStep, ...]:
    """The steps of a whole calibration; `InputError` when a radius or the number of loadings lies outside its range.

    Parameters
    ----------
    tips_mm
        Radii of the tips of the loading machine, each in [0.1, 1000] mm.
    repeats
        Loadings of each tip, in [1, 20].
    pads_kpa
        Moduli of the soft flat pads that measure the light on dents, each in [0.5, 200] kPa.

    Examples
    --------
    >>> [step.name for step in plan_steps((2.0, 10.0))]
    ['dark', 'untouched', 'flat-1', 'flat-2', 'flat-3', 'board-untouched', 'board', 'edge', 'tip-2mm-1', 'tip-10mm-1']
    """
    require_integer("repeats", repeats, 1, 20)
    radii = [require_number("tip_radius_mm", tip, 0.1, 1000.0, hint="millimetres") for tip in tips_mm]
    flats = [
        CalibrationStep(
            name=f"{FLAT}-{level}",
            instruction=f"Press the whole face evenly on a soft flat pad, {how} (evens out the light)",
            frames=FLAT_FRAMES,
            optional=True,
        )
        for level, how in enumerate(("lightly", "harder", "as hard as it goes without white spots"), start=1)
    ]
    loadings = [
        CalibrationStep(
            name=f"{_tip_name(tip)}-{run}",
            instruction=(
                f"Mount the tip of {tip:g} mm radius, not yet touching; then load from 0 to {LARGEST_N:g} N in steps "
                f"of {STEP_N:g} N and back to 0"
            ),
            tip_mm=tip,
            run=run,
        )
        for run in range(1, repeats + 1)
        for tip in radii
    ]
    soft = [
        CalibrationStep(
            name=f"{PAD}-{require_number('pad_kpa', pad, 0.5, 200.0, hint='kilopascals'):g}kPa",
            instruction=(
                f"Press the whole face on the soft flat pad of {pad:g} kPa, {PAD_THICKNESS_MM:g} mm thick, not yet "
                f"touching; then load from 0 to {PAD_FORCES_N[-1]:g} N in steps of about 0.2 N (measures the light on "
                "dents)"
            ),
            optional=True,
            pad_kpa=float(pad),
        )
        for pad in pads_kpa
    ]
    return (
        CalibrationStep(name=DARK, instruction="Switch the lamps off, or cover the lens", frames=STILL_FRAMES),
        CalibrationStep(name=UNTOUCHED, instruction="Switch the lamps on, touch nothing", frames=STILL_FRAMES),
        *flats,
        CalibrationStep(
            name=BOARD_UNTOUCHED,
            instruction="Light the probe as for the dot board (white light where it needs some), touch nothing",
            frames=BOARD_FRAMES,
        ),
        CalibrationStep(name=BOARD, instruction="Press the dot board on the face", frames=BOARD_FRAMES),
        CalibrationStep(
            name=EDGE,
            instruction="Press a block with a straight edge on one half of the face, a little askew",
            frames=EDGE_FRAMES,
            optional=True,
        ),
        *loadings,
        *soft,
    )


def _tip_name(radius_mm: float) -> str:
    """Name of a tip in folders, e.g. ``tip-2mm``."""
    return f"tip-{radius_mm:g}mm"


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSetup(ContentValue):
    """Setup of a calibration session.

    Raises `InputError` when a value has the wrong type or is outside its range.

    Parameters
    ----------
    name
        Display name of the calibration; printable, at most 200 characters.
    probe, camera
        Names of both.
    began
        Start of the session, with its time zone; None for a simulated one.
    settings
        Camera settings during the session.
    pitch_mm, pitch_sd_mm
        Pitch of the dot board and its standard uncertainty, mm.
    gauge_share
        Relative standard deviation of the force gauge, from its certificate.
    patch_px
        Reference patch that shows the lamps past the probe: left, top, right, bottom; None without one.
    tips_mm, repeats
        Radii of the tips, all different, and loadings of each.
    pads_kpa, pad_sd
        Moduli of the soft flat pads, all different, and their relative standard uncertainty; without pads the light on
        dents is not measured.
    """

    name: str
    probe: str
    camera: str
    began: datetime | None = None
    settings: Mapping[str, float] = field(default_factory=dict)
    pitch_mm: float = 2.5
    pitch_sd_mm: float = 0.0
    gauge_share: float = 0.001
    patch_px: tuple[int, int, int, int] | None = None
    tips_mm: tuple[float, ...] = TIPS_MM
    repeats: int = 1
    pads_kpa: tuple[float, ...] = ()
    pad_sd: float = 0.05

    def __post_init__(self) -> None:
        for name in ("name", "probe", "camera"):
            require_name(name, getattr(self, name))
        require_time("began", self.began)
        require_number("pitch_mm", self.pitch_mm, 0.05, 50.0, hint="millimetres")
        require_number("pitch_sd_mm", self.pitch_sd_mm, 0.0, 1.0, hint="millimetres")
        require_number("gauge_share", self.gauge_share, 0.0, 0.5, hint="a fraction of 1")
        require_number("pad_sd", self.pad_sd, 0.001, 0.5, hint="a fraction of 1")
        if len(set(self.pads_kpa)) < len(self.pads_kpa):
            raise InputError(name="pads_kpa", requirement="must hold each pad once", value=str(list(self.pads_kpa)))
        steps = [step.name for step in plan_steps(self.tips_mm, repeats=self.repeats, pads_kpa=self.pads_kpa)]
        if len(set(steps)) < len(steps):
            raise InputError(
                name="tips_mm",
                requirement="must hold each tip once",
                value=str(list(self.tips_mm)),
                hint="take repeats instead",
            )
        if self.patch_px is not None:
            left, top, right, bottom = self.patch_px
            if not (0 <= left < right and 0 <= top < bottom):
                requirement = "must be left < right and top < bottom, from 0"
                raise InputError(name="patch_px", requirement=requirement, value=str(self.patch_px))
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))

    def differing(self, other: SessionSetup) -> tuple[str, ...]:
        """Names of the values entered by a person that differ; probe and camera are not compared."""
        return tuple(name for name in STATED if getattr(self, name) != getattr(other, name))

    def changed_setting(self, settings: Mapping[str, float]) -> tuple[str, float, float] | None:
        """Name, old and new value of a setting that changed since the session began; None without a change."""
        for setting, value in self.settings.items():
            now = settings.get(setting, value)
            if not math.isclose(now, value, rel_tol=SETTING_TOLERANCE, abs_tol=1e-9):
                return setting, value, now
        return None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibrationFrame:
    """A frame of a calibration step.

    Parameters
    ----------
    image
        The raw camera frame.
    force_n
        Force of the gauge, newtons; None in steps without force.
    time_s
        Arrival time, seconds on the camera's or the computer's clock; None when unknown.
    """

    image: TactileImage
    force_n: float | None = None
    time_s: float | None = None

    def __post_init__(self) -> None:
        require_type("image", self.image, TactileImage)
        if self.force_n is not None:
            require_number("force_n", self.force_n, -100.0, 100.0, hint="newtons")
        if self.time_s is not None:
            require_number("time_s", self.time_s, -1e15, 1e15, hint="seconds")


class SessionFolder:
    """A session's folder.

    Parameters
    ----------
    path
        The folder; it need not exist before `begin`.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = as_path(path)

    @property
    def begun(self) -> bool:
        """Whether it contains a session."""
        return (self.path / SETUP_FILE).exists()

    def begin(self, setup: SessionSetup) -> None:
        """Create the folder and write the setup.

        Raises `FileInputError` when it contains a session already or cannot be written.
        """
        if self.begun:
            raise FileInputError(
                f"{printable_path(self.path)} must hold no session yet; it does (go on with it, or choose another)"
            )
        document = {"format": FORMAT, "version": VERSION, "notice": RESEARCH_USE_ONLY, "terms": to_json_value(setup)}
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            write_durably(self.path / SETUP_FILE, json_bytes(document))
        except OSError as error:
            raise _refused(self.path, error, kind="folder") from error

    def setup(self) -> SessionSetup:
        """The setup of the session; `FileInputError` when it is missing or invalid."""
        file = self.path / SETUP_FILE
        document = read_object(file, most=LARGEST_SETUP_BYTES)
        if (document.get("format"), document.get("version")) != (FORMAT, VERSION):
            raise FileInputError(f"{printable_path(file)} must be a {FORMAT} of version {VERSION}; got another format")
        try:
            return from_json_value(SessionSetup, document.get("terms"), "terms")
        except InputError as error:
            raise FileInputError(f"{printable_path(file)} must be the terms of a session; got: {error}") from error

    def plan(self) -> tuple[CalibrationStep, ...]:
        """The session's steps."""
        setup = self.setup()
        return plan_steps(setup.tips_mm, repeats=setup.repeats, pads_kpa=setup.pads_kpa)

    def done(self, step: CalibrationStep) -> bool:
        """Whether all frames of the step are stored."""
        return (self.path / step.name / INDEX).exists()

    def missing(self) -> tuple[str, ...]:
        """Names of the required steps that are not done."""
        return tuple(step.name for step in self.plan() if not (step.optional or self.done(step)))

    def save(
        self,
        step: CalibrationStep,
        shots: Iterable[CalibrationFrame],
        *,
        progress: Callable[[int], None] = lambda stored: None,
    ) -> int:
        """Store the frames of a step, all or none, and return their number.

        Raises `CalibrationError` when there are none; `FileInputError` when they cannot be written, or the step was
        done before.
        """
        path, draft = self.path / step.name, self._hidden(step)
        try:
            if path.exists():
                cure = "remove it to repeat the step"
                raise FileInputError(f"{printable_path(path)} must be new; it exists already ({cure})")
            for killed in self.path.glob(f".{step.name}-*"):  # drafts of a killed program
                shutil.rmtree(killed, ignore_errors=True)
            draft.mkdir()
            stored = self._write(draft, shots, progress)
            draft.rename(path)
        except OSError as error:
            raise _refused(self.path, error, kind="folder") from error
        finally:
            shutil.rmtree(draft, ignore_errors=True)  # of an unfinished step
        return stored

    def count(self, step: CalibrationStep) -> int:
        """Number of frames of the step; 0 when it is not done."""
        return len(list((self.path / step.name).glob("frame-*.png"))) if self.done(step) else 0

    def forget(self, step: CalibrationStep) -> None:
        """Remove the frames of a step, if any, so that it can be repeated.

        Raises `FileInputError` when they cannot be removed; the step is still done then.
        """
        path = self.path / step.name
        if not path.exists():
            return
        try:
            # The rename makes the removal atomic.
            path.rename(going := self._hidden(step))
        except OSError as error:
            raise _refused(self.path, error, kind="folder") from error
        shutil.rmtree(going, ignore_errors=True)  # `save` removes the remainder

    def shots(self, step: CalibrationStep) -> list[CalibrationFrame]:
        """Read the frames of a step in the order of acquisition.

        Raises `CalibrationError` when the step was not done; `FileInputError` when a file is missing or damaged.
        """
        index, rows = self._rows(step)
        return [self._shot(index, row) for row in rows]

    def middle_shot(self, step: CalibrationStep) -> CalibrationFrame:
        """The middle frame of a step, in loadings near the largest force; errors as `shots`."""
        index, rows = self._rows(step)
        return self._shot(index, rows[len(rows) // 2])

    def _rows(self, step: CalibrationStep) -> tuple[Path, list[list[str]]]:
        """The step's table of frames, and its rows."""
        if not self.done(step):
            raise CalibrationError(
                f"step {step.name!r} must be done first; {printable_path(self.path)} holds no frames of it"
            )
        index = self.path / step.name / INDEX
        name, content = printable_path(index), read_bytes(index, most=LARGEST_INDEX_BYTES)
        if content.count(b"\n") + content.count(b"\r") > MOST_LINES:
            raise FileInputError(f"{name} must have at most {MOST_LINES} lines; it has more")
        try:
            rows = list(csv.reader(io.StringIO(content.decode("utf-8", errors="replace"))))
        except csv.Error as error:
            raise FileInputError(f"{name} must be a table of frames; got: {one_line(error)}") from error
        if not rows or tuple(rows[0]) != COLUMNS:
            raise FileInputError(f"{name} must begin with the line {','.join(COLUMNS)}")
        frames = [row for row in rows[1:] if row]
        if len({row[0] for row in frames}) < len(frames):  # a small file could otherwise take any amount of memory
            raise FileInputError(f"{name} must name each frame once; it names one twice")
        if not frames:
            raise FileInputError(f"{name} must name at least one frame; got none (remove the step, repeat it)")
        return index, frames

    def _write(self, draft: Path, shots: Iterable[CalibrationFrame], progress: Callable[[int], None]) -> int:
        lines = [",".join(COLUMNS)]
        for number, shot in enumerate(shots):
            name = f"frame-{number:04d}.png"
            (draft / name).write_bytes(png_bytes(shot.image))
            lines.append(f"{name},{_text(shot.time_s)},{_text(shot.force_n)},{_text(shot.image.full_scale)}")
            progress(number + 1)
        if len(lines) == 1:
            raise CalibrationError("a step must hold at least one frame; got none (does the camera deliver?)")
        write_durably(draft / INDEX, ("\n".join(lines) + "\n").encode())
        return len(lines) - 1

    def _shot(self, index: Path, row: list[str]) -> CalibrationFrame:
        try:
            name, time_s, force_n, full_scale = row
            if name != as_path(name).name:
                raise InputError(f"must name files of its own folder; got {name!r:.80}")
            image = replace(read_image(index.parent / name), full_scale=float(full_scale))
            return CalibrationFrame(image=image, time_s=_number(time_s), force_n=_number(force_n))
        except FileInputError:
            raise
        except ValueError as error:
            raise FileInputError(
                f"{printable_path(index)} must hold a file, a time, a force and a full scale a line; got: "
                f"{one_line(error)}"
            ) from error

    def _hidden(self, step: CalibrationStep) -> Path:
        """A new folder for frames of the step that do not count."""
        return self.path / f".{step.name}-{secrets.token_hex(4)}"


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.9g}"


def _number(text: str) -> float | None:
    return float(text) if text else None


def saved_calibration(session: SessionFolder) -> Path | None:
    """The calibration file of the present frames; None before `save_calibration`."""
    file = session.path / CALIBRATION_FILE
    return file if file.exists() else None


def save_calibration(session: SessionFolder, calibration: ProbeCalibration) -> Path:
    """Write the calibration into the session's folder, over an earlier one, and return its file.

    Raises `FileInputError` when it cannot be written.
    """
    file = session.path / CALIBRATION_FILE
    content = calibration_bytes(calibration)
    try:
        write_durably(file, content)
    except OSError as error:
        raise _refused(file, error) from error
    return file


def archive_calibration(session: SessionFolder) -> Path | None:
    """Rename the calibration after its identity, because its frames change; return the new path, None without one.

    Results may cite it, so it is never removed; a damaged file gets a random name. Raises `FileInputError` when it
    cannot be renamed.
    """
    file = saved_calibration(session)
    if file is None:
        return None
    aside = file.with_name(f"calibration-{_short_identity(file)}.json")
    try:
        file.replace(aside)
    except OSError as error:
        raise _refused(file, error) from error
    return aside


def _short_identity(file: Path) -> str:
    try:
        return calibration_sha256(read_calibration(file))[:SHORT]
    except TsisError:  # a damaged file must not block the session or replace another
        return f"damaged-{secrets.token_hex(SHORT // 2)}"


def _refused(path: Path, error: OSError, *, kind: str = "file") -> FileInputError:
    reason = error.strerror or error
    return FileInputError(f"{printable_path(path)} must be a {kind} that can be written; got: {reason}")


class LiveCalibration:
    """Takes calibration frames from a running acquisition.

    Parameters
    ----------
    acquisition
        Running.
    log
        Readings of the gauge, if any.
    """

    def __init__(self, acquisition: Acquisition, log: ForceLog | None = None) -> None:
        self._acquisition, self._log = acquisition, log

    def still(self, frames: int) -> Iterator[CalibrationFrame]:
        """Yield the next frames, all taken after the call; `CameraError` when no frame arrives for 5 s."""
        for _, received in zip(range(frames), self._fresh(), strict=False):
            yield CalibrationFrame(image=received.frame.tactile_image(), time_s=received.arrived_s)

    def loading(self, over: Callable[[], bool], *, every_s: float = 0.5) -> Iterator[CalibrationFrame]:
        """Yield a frame with its force every ``every_s`` seconds until ``over`` is true.

        Raises `CameraError` when no frame arrives for 5 s; `GaugeError` when the gauge stops sending.
        """
        assert self._log is not None  # without a gauge use `take_frame`
        last_s = float("-inf")
        for received in self._fresh():
            if over():
                return
            if received.arrived_s - last_s >= every_s:
                last_s = received.arrived_s
                self._log.wait_until(last_s, timeout_s=FORCE_S)
                force = self._log.at(last_s).force_n
                yield CalibrationFrame(image=received.frame.tactile_image(), time_s=last_s, force_n=force)

    def take_frame(self, force_n: float) -> CalibrationFrame:
        """The next frame, with a force that the user entered."""
        received = next(self._fresh())
        return CalibrationFrame(image=received.frame.tactile_image(), time_s=received.arrived_s, force_n=force_n)

    def _fresh(self) -> Iterator[ReceivedFrame]:
        ring = self._acquisition.ring
        position = ring.end
        while True:
            if not ring.wait(position, TIMEOUT_S):
                why = f": {self._acquisition.failure}" if self._acquisition.failure is not None else ""
                raise CameraError(f"{self._acquisition.name} must bring frames; none came for {TIMEOUT_S:g} s{why}")
            arrivals, position, _ = ring.read(position)
            yield from arrivals


def _read_loading(shots: Sequence[CalibrationFrame], step: CalibrationStep, reference: CameraReference) -> Loading:
    """Read a loading without presses that are too light for the gauge to detect."""
    assert step.tip_mm is not None
    forces = _forces(shots)
    zero = forces[0]
    readings = []
    for shot, force in zip(shots, forces, strict=True):
        load = force - zero
        if abs(load) <= UNTOUCHED_N or load >= TOUCHED_N:
            reading = read_loading_frame(shot.image, reference, force_n=zero + load, touched=load >= TOUCHED_N)
            readings.append(reading)
    loading = Loading.from_frames(step.tip_mm, readings, run=step.run)
    first = float(loading.total_grey[0] / max(loading.total_grey.max(), 1.0))
    if first > AT_REST:
        raise CalibrationError(
            f"the tip must not touch in the first frame, whose force is the gauge's zero; it shows {first:.0%} of the "
            "largest sum of grey levels (repeat the step, and begin it untouched)"
        )
    _require_rising(loading)
    return loading


def _require_measured_slope(line: ForceLine) -> None:
    """Refuse a force line whose slope is consistent with zero."""
    low, high = line.slope_grey_per_n.interval()
    if low <= 0:
        raise CalibrationError(
            f"the slope of the force line must differ from zero; its 95 % interval is {low:.3g} to {high:.3g} grey "
            "levels a newton, for the loadings disagree (repeat those that stand out, or load three tips or more)"
        )


def _forces(shots: Sequence[CalibrationFrame]) -> list[float]:
    """Forces of a loading; frames without a force and repeated pictures are refused, as live noise never repeats."""
    forces = [float(shot.force_n) for shot in shots if shot.force_n is not None]
    if len(forces) < len(shots):
        raise CalibrationError("every frame must have a force; one has none (is the gauge silent?)")
    for number, (before, after) in enumerate(pairwise(shots), start=1):
        if np.array_equal(before.image.grey, after.image.grey):
            raise CalibrationError(
                f"every frame must be a new one; frames {number} and {number + 1} are identical (is the camera frozen? "
                "open it again, and repeat the step)"
            )
    return forces


def _require_rising(loading: Loading) -> None:
    run = fit_run(loading)
    with np.errstate(invalid="ignore", divide="ignore"):  # undefined for equal sums
        correlation = float(np.corrcoef(run.force_n, run.total_grey)[0, 1])
    if not correlation >= LEAST_CORRELATION:
        raise CalibrationError(
            f"the sum of grey levels must rise with the force, correlated with it by {LEAST_CORRELATION:g} or more; "
            f"got {correlation:.2f} (do frames and forces belong together? repeat the step)"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionResult:
    """Diagnostics of a calibration, for the reader and for figures.

    Attributes
    ----------
    dots
        The dots of the board, and their residuals.
    board
        The frame of the board.
    loadings
        The loadings.
    line
        Diagnostics of the force line.
    response
        Gain and saturation with their intervals.
    dents
        Light on dents, where pads were pressed.
    """

    dots: DotDiagnostics
    board: TactileImage
    loadings: tuple[Loading, ...]
    line: ForceLineDiagnostics
    response: PressureResponse
    dents: DentLight | None = None


def calibrate(
    session: SessionFolder,
    *,
    days: float = VALID_DAYS,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[ProbeCalibration, SessionResult]:
    """Compute the calibration from the frames of a session; optional steps are used where they were done.

    Raises `CalibrationError` when a step is missing, or its frames fail a check; the message names the step;
    `FileInputError` when a file of the session is missing or damaged.

    Parameters
    ----------
    session
        With at least the dark, untouched, board and loading steps done.
    days
        Validity in days, in [1, 3650], from the start of the session, also when the file is computed again. A
        simulated calibration does not expire.
    progress
        Called with (steps done, steps in all).
    """
    require_number("days", days, 1, 3650)
    with one_blas_thread():  # sums of several threads depend on their number, and files are compared by their hash
        return _calibrated(session, days, progress)


def _calibrated(
    session: SessionFolder, days: float, progress: Callable[[int, int], None]
) -> tuple[ProbeCalibration, SessionResult]:
    setup, steps = session.setup(), {step.name: step for step in session.plan()}
    if missing := session.missing():
        raise CalibrationError(
            f"steps must be done first: {', '.join(missing)}; {printable_path(session.path)} lacks them"
        )
    still = [step for step in steps.values() if not step.is_loading]
    shots: dict[str, list[CalibrationFrame]] = {}
    for number, step in enumerate(still):
        if session.done(step):
            shots[step.name] = session.shots(step)
            _require_same_format(shots[step.name], step, shots[DARK][0].image)
        progress(number + 1, len(steps) + 1)
    board, untouched = _mean(shots[BOARD]), _mean(shots[BOARD_UNTOUCHED])
    with _named(BOARD):
        scale, dots = scale_from_dots(board, untouched, pitch_mm=setup.pitch_mm, pitch_sd_mm=setup.pitch_sd_mm)
    reference = _reference(shots, scale, setup.patch_px)
    loadings = []
    for step in steps.values():
        if step.tip_mm is not None:  # in turn, because the frames of a large camera fill the memory
            pressed = session.shots(step)
            _require_same_format(pressed, step, shots[DARK][0].image)
            with _named(step.name):
                loadings.append(_read_loading(pressed, step, reference))
            progress(len(still) + len(loadings), len(steps) + 1)
    line, diagnostics = fit_force_line(loadings, reference=reference, gauge_fraction=setup.gauge_share)
    _require_measured_slope(line)
    # The pitch has one error along both axes, so the relative errors of a pixel's sides add to that of its area.
    area = sum(size.sd / size.value for size in (scale.mm_per_pixel_x, scale.mm_per_pixel_y))
    response = fit_response(loadings, reference=reference, gauge_fraction=setup.gauge_share, area_fraction=area)
    by_tips = response.calibration(reference, name=setup.name, probe=setup.probe)
    dents, ratio = _dents(session, setup, by_tips, reference, loadings, line)
    line = replace(line, soft_ratio=ratio)
    times = [shot.time_s for shot in shots[UNTOUCHED] if shot.time_s is not None]
    calibration = ProbeCalibration(
        name=setup.name,
        probe=setup.probe,
        camera=setup.camera,
        settings=setup.settings,
        made=setup.began,
        expires=None if setup.began is None else setup.began + timedelta(days=days),
        scale=scale,
        reference=reference,
        force_line=line,
        response=by_tips,
        tissue=None if dents is None else dents.response,
        specification=specification_sheet(
            probe=setup.probe,
            line=line,
            diagnostics=diagnostics,
            edge_mm=_edge(shots, reference),
            frames_per_s=frame_rate(times) if len(times) == len(shots[UNTOUCHED]) else None,
        ),
    )
    progress(len(steps) + 1, len(steps) + 1)
    return calibration, SessionResult(
        dots=dots, board=board, loadings=tuple(loadings), line=diagnostics, response=response, dents=dents
    )


def _dents(
    session: SessionFolder,
    setup: SessionSetup,
    response: Calibration,
    reference: CameraReference,
    loadings: Sequence[Loading],
    line: ForceLine,
) -> tuple[DentLight | None, MeasuredValue | None]:
    """Light on dents from the pads that were pressed, and the force of the line over theirs; None without any."""
    pads = [step for step in session.plan() if step.pad_kpa is not None and session.done(step)]
    if not pads or reference.mm_per_pixel is None:
        return None, None
    probe, presses, ratios = load_probe(setup.probe), [], []
    for step in pads:
        with _named(step.name):
            shots = session.shots(step)
            presses.append(_read_pad(shots, step, reference, ring_edges_mm(probe)))
            ratios += _line_over_gauge(shots, line, reference)
    pixel = reference.mm_per_pixel[0] * reference.mm_per_pixel[1]
    simulated = setup.began is None
    with _named(pads[0].name):
        dent_light = fit_dent_light(
            presses,
            loadings,
            probe=probe,
            response=response,
            pixel_mm2=pixel,
            pad_sd=setup.pad_sd,
            strain="small" if simulated else "finite",  # the virtual bench presses its pads at small strain
        )
    if len(ratios) < FEWEST_SEEN:
        return dent_light, None
    mean, sd = float(np.mean(ratios)), float(np.std(ratios, ddof=1))
    return dent_light, MeasuredValue(value=mean, sd=sd, degrees_of_freedom=len(ratios) - 1.0)


def _line_over_gauge(shots: Sequence[CalibrationFrame], line: ForceLine, reference: CameraReference) -> list[float]:
    """Force by the line of the tips over that of the gauge, for each press on a pad."""
    zero, ratios = float(shots[0].force_n or 0.0), []
    for shot in shots:
        if (force := float(shot.force_n or 0.0) - zero) >= LEAST_PAD_N:
            frame = replace(shot.image, mm_per_pixel=reference.mm_per_pixel)
            total = total_grey(frame, reference, method=line.method)
            if total > 0:  # at the exposure of the tips, pads may be too dark
                ratios.append((total - line.intercept_grey.value) / line.slope_grey_per_n.value / force)
    return ratios


def _read_pad(
    shots: Sequence[CalibrationFrame], step: CalibrationStep, reference: CameraReference, edges_mm: NDArray[np.float64]
) -> PadPresses:
    """Read the rings of presses on a pad up to the largest force."""
    assert step.pad_kpa is not None
    load = np.array(_forces(shots))
    load -= load[0]
    rising = slice(0, int(load.argmax()) + 1)  # pads creep, and unloading shows it
    grey, variance = [], []
    for shot in shots[rising]:
        rings = radial_profile(
            reference.corrected(replace(shot.image, mm_per_pixel=reference.mm_per_pixel)), edges_mm=edges_mm
        )
        grey.append(np.where(rings.clipped_count > 0, np.nan, rings.mean_grey))
        pixel = (
            reference.read_noise_grey.value**2 + reference.shot_noise_grey.value * np.maximum(grey[-1], 0.0) + 1 / 12
        )
        variance.append(pixel / np.maximum(rings.count, 1))
    return PadPresses(
        young_kpa=step.pad_kpa, force_n=load[rising], grey=np.array(grey), variance=np.nan_to_num(np.array(variance))
    )


def _reference(
    shots: Mapping[str, Sequence[CalibrationFrame]], scale: PixelScale, patch_px: tuple[int, int, int, int] | None
) -> CameraReference:
    def scaled(name: str) -> list[TactileImage]:
        return [scale.on(shot.image) for shot in shots[name]]

    flats = [scaled(name) for name in sorted(shots) if name.startswith(f"{FLAT}-")]
    # Without flats, only the light beside the dot board shows the photon noise.
    scenes = [] if flats else [scaled(BOARD_UNTOUCHED)]
    return make_reference(scaled(DARK), scaled(UNTOUCHED), flats, patch_px=patch_px, scenes=scenes)


def _edge(shots: Mapping[str, Sequence[CalibrationFrame]], reference: CameraReference) -> MeasuredValue | None:
    if EDGE not in shots:
        return None
    with _named(EDGE):
        return edge_width(reference.corrected(replace(_mean(shots[EDGE]), mm_per_pixel=reference.mm_per_pixel)))


def _require_same_format(shots: Sequence[CalibrationFrame], step: CalibrationStep, first: TactileImage) -> None:
    expected = (first.grey.shape, first.full_scale)
    for shot in shots:
        got = (shot.image.grey.shape, shot.image.full_scale)
        if got != expected:
            raise ImageMismatchError(
                f"step {step.name!r}: frames must have the shape {expected[0]} and full scale {expected[1]:g} of step "
                f"{DARK!r}; got {got[0]} and {got[1]:g} (remove the step's folder and repeat it in that mode)"
            )


@contextmanager
def _named(step: str) -> Iterator[None]:
    """Prefix errors with the name of the step."""
    try:
        yield
    except (CalibrationError, InputError) as error:
        raise CalibrationError(f"step {step!r}: {error}") from error


def _mean(shots: Sequence[CalibrationFrame]) -> TactileImage:
    """The mean of frames of one scene."""
    return replace(shots[0].image, grey=np.mean([shot.image.grey for shot in shots], axis=0))
