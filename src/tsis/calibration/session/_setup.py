"""The setup of a calibration session, and its steps in order with instructions."""

from __future__ import annotations

import math
from collections.abc import Mapping  # noqa: TC003 - the file format reads the type
from dataclasses import dataclass, field
from datetime import datetime  # noqa: TC003 - the file format reads the type
from types import MappingProxyType
from typing import TYPE_CHECKING

from tsis.calibration.dents import PAD_THICKNESS_MM
from tsis.calibration.file import SETTING_TOLERANCE, require_name, require_time
from tsis.calibration.force import LARGEST_N, STEP_N, TIPS_MM
from tsis.errors import InputError
from tsis.model.content import ContentValue
from tsis.model.require import require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Sequence


DARK, UNTOUCHED, FLAT, BOARD_UNTOUCHED, BOARD, EDGE = "dark", "untouched", "flat", "board-untouched", "board", "edge"
STILL_FRAMES, FLAT_FRAMES, BOARD_FRAMES, EDGE_FRAMES = 16, 8, 4, 4
FLAT_LEVELS = 3
PAD, PAD_FORCES_N = "pad", (0.0, 0.4, 0.6, 0.8, 1.0, 1.2)  # of a virtual loading; a person loads about so


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
            name=f"{tip_name(tip)}-{run}",
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


def tip_name(radius_mm: float) -> str:
    """Name of a tip in folders, e.g. ``tip-2mm``."""
    return f"tip-{radius_mm:g}mm"


STATED = (
    "name",
    "pitch_mm",
    "pitch_sd_mm",
    "gauge_share",
    "patch_px",
    "tips_mm",
    "repeats",
    "pads_kpa",
    "pad_sd",
)  # by a person


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
        """Names of the terms entered by a person that differ; probe and camera are not compared.

        Examples
        --------
        >>> terms = SessionSetup(name="bench", probe="tsis-direct", camera="cam")
        >>> terms.differing(SessionSetup(name="bench", probe="tsis-direct", camera="cam", pitch_mm=2.0, repeats=3))
        ('pitch_mm', 'repeats')
        """
        return tuple(name for name in STATED if getattr(self, name) != getattr(other, name))

    def changed_setting(self, settings: Mapping[str, float]) -> tuple[str, float, float] | None:
        """Name, old and new value of a setting that changed since the session began; None without a change.

        Examples
        --------
        >>> terms = SessionSetup(name="bench", probe="tsis-direct", camera="cam", settings={"gain": 2.0})
        >>> terms.changed_setting({"gain": 3.0, "exposure_ms": 5.0}), terms.changed_setting({"gain": 2.0})
        (('gain', 2.0, 3.0), None)
        """
        for setting, value in self.settings.items():
            now = settings.get(setting, value)
            if not math.isclose(now, value, rel_tol=SETTING_TOLERANCE, abs_tol=1e-9):
                return setting, value, now
        return None
