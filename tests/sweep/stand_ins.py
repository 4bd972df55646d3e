"""A small plan, presses that cost nothing and presses that go wrong; workers import them from here."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.catalog.probes import load_probe
from tsis.errors import MechanicsError
from tsis.model.press import PressField
from tsis.sweep.plan import Plan, Range

if TYPE_CHECKING:
    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe

MARKER = "TSIS_TEST_MARKER"
TOO_STIFF_KPA = 150.0
GENTLE_N = 1e-3  # with less, a sweep only asks whether the model takes its presses
QUANTITIES = {
    "tissue_young_kpa": 5.0,
    "thickness_mm": 40.0,
    "diameter_mm": Range(low=4.0, high=12.0),
    "depth_mm": Range(low=6.0, high=16.0),
    "young_kpa": Range(low=20.0, high=200.0, logarithmic=True),
}


def small_plan(**changes: Any) -> Plan:
    """60 phantoms in 6 files."""
    given: dict[str, Any] = {
        "probe": load_probe(),
        "quantities": QUANTITIES,
        "count": 60,
        "seed": 4,
        "batch": 10,
        "radii_mm": (0.0, 3.0, 12.0),
    }
    return Plan(**(given | changes))


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a folder."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def quick(probe: Probe, phantom: Phantom, *, force_n: float, strain: str) -> PressField:
    """Smooth numbers that depend on everything."""
    radius = np.linspace(0.0, probe.radius_mm, 25)
    lump = phantom.inclusion
    bump = 0.0 if lump is None else lump.diameter_mm / lump.depth_mm * np.log(lump.young_kpa)
    pressure = force_n * np.exp(-((radius / probe.radius_mm) ** 2)) * (1 + bump)
    return PressField(
        radius_mm=radius,
        face_displacement_mm=pressure / phantom.young_kpa,
        pressure_kpa=pressure,
        approach_mm=force_n / phantom.young_kpa * len(strain),
        force_n=force_n,
    )


def refusing(probe: Probe, phantom: Phantom, *, force_n: float, strain: str) -> PressField:
    """Refuses stiff inclusions."""
    if phantom.inclusion is not None and phantom.inclusion.young_kpa > TOO_STIFF_KPA:
        raise MechanicsError(f"young_kpa must be at most {TOO_STIFF_KPA:g}; got {phantom.inclusion.young_kpa:g}")
    return quick(probe, phantom, force_n=force_n, strain=strain)


def deadly_once(probe: Probe, phantom: Phantom, *, force_n: float, strain: str) -> PressField:
    """Kills its worker at the first press that meets a new phantom, until three have died."""
    if force_n > GENTLE_N:
        died = len(list(Path(os.environ[MARKER]).iterdir()))
        if died < 3:
            (Path(os.environ[MARKER]) / str(os.getpid())).touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return quick(probe, phantom, force_n=force_n, strain=strain)


def deadly(probe: Probe, phantom: Phantom, *, force_n: float, strain: str) -> PressField:
    """Kills every worker."""
    if force_n > GENTLE_N:
        os._exit(1)
    return quick(probe, phantom, force_n=force_n, strain=strain)


def faulty(probe: Probe, phantom: Phantom, *, force_n: float, strain: str) -> PressField:
    """Has a fault, as programs have."""
    if force_n > GENTLE_N:
        raise TypeError("of all things")
    return quick(probe, phantom, force_n=force_n, strain=strain)
