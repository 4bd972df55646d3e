"""What was calibrated and with what, as the person at the bench stated it."""

from __future__ import annotations

import math
from collections.abc import Mapping  # noqa: TC003 - the file format reads the type
from dataclasses import dataclass, field
from datetime import datetime  # noqa: TC003 - the file format reads the type
from types import MappingProxyType

from tsis.calibration.file.probe_calibration import SETTING_TOLERANCE
from tsis.calibration.file.soundness import require_name, require_time
from tsis.calibration.force.loading import TIPS_MM
from tsis.calibration.session.steps import plan_steps
from tsis.model.check import require_number
from tsis.model.errors import InputError

STATED = ("name", "pitch_mm", "pitch_sd_mm", "gauge_share", "patch_px", "tips_mm", "repeats")  # by a person


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSetup:
    """Terms of a calibration session.

    Parameters
    ----------
    name
        What people will call the calibration; like all names printable and at most 200 characters.
    probe, camera
        Names of both.
    began
        When the session began, with its time zone; None for a simulated bench.
    settings
        Camera settings during the session.
    pitch_mm, pitch_sd_mm
        Pitch of the dot board and its standard uncertainty, mm.
    gauge_share
        Relative standard deviation of the force gauge, from its certificate.
    patch_px
        Where the lamps are seen past the probe: left, top, right, bottom; None when nowhere.
    tips_mm, repeats
        Radii of the tips, no two alike, and loadings of each.

    Raises
    ------
    InputError
        When a value is of the wrong kind or outside its range, so that no session begins which cannot end.
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

    def __post_init__(self) -> None:
        for name in ("name", "probe", "camera"):
            require_name(name, getattr(self, name))
        require_time("began", self.began)
        require_number("pitch_mm", self.pitch_mm, 0.05, 50.0, hint="millimetres")
        require_number("pitch_sd_mm", self.pitch_sd_mm, 0.0, 1.0, hint="millimetres")
        require_number("gauge_share", self.gauge_share, 0.0, 0.5, hint="a share of one")
        steps = [step.name for step in plan_steps(self.tips_mm, repeats=self.repeats)]
        if len(set(steps)) < len(steps):
            raise InputError(f"tips_mm must hold each tip once; got {list(self.tips_mm)} (take repeats instead)")
        if self.patch_px is not None:
            left, top, right, bottom = self.patch_px
            if not (0 <= left < right and 0 <= top < bottom):
                raise InputError(f"patch_px must be left < right and top < bottom, from 0; got {self.patch_px}")
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))

    def differing(self, other: SessionSetup) -> tuple[str, ...]:
        """Names of the terms that a person states and that are others there; of probe and camera nothing is said.

        Examples
        --------
        >>> terms = SessionSetup(name="bench", probe="tsis-direct", camera="cam")
        >>> terms.differing(SessionSetup(name="bench", probe="tsis-direct", camera="cam", pitch_mm=2.0, repeats=3))
        ('pitch_mm', 'repeats')
        """
        return tuple(name for name in STATED if getattr(self, name) != getattr(other, name))

    def changed_setting(self, settings: Mapping[str, float]) -> tuple[str, float, float] | None:
        """A setting of the session that is another one now: its name, its value then and now; else None.

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
