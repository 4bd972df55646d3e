"""Estimate the map of a scan."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tsis.mapping.lump_map import LumpMap
    from tsis.mapping.prior import MapPrior
    from tsis.mapping.scan import Scan
    from tsis.model.calibration import Calibration
    from tsis.model.probe import Probe


def estimate_map(
    scan: Scan,
    *,
    probe: Probe | None = None,
    calibration: Calibration | None = None,
    prior: MapPrior | None = None,
    strain: str | None = None,
    voxel_mm: float = 2.0,
    seed: int = 0,
    steps: int = 20000,
    progress: Callable[[int, int], None] | None = None,
    resume: Path | None = None,
) -> LumpMap:
    """Map lumps under the area of a scan.

    Parameters
    ----------
    scan
        The presses.
    probe
        The probe that pressed; not needed for pairs of travel and force.
    calibration
        Response of grey level to pressure and the errors; needed for frames.
    prior
        Tissue and lumps; `MapPrior` by default.
    strain
        ``"small"`` or ``"finite"``; by default as frames of a virtual probe state, else small.
    voxel_mm
        Width of the map's voxels.
    seed
        Of the sampler.
    steps
        Steps of the sampler a block of presses.
    progress
        Called with (done, all).
    resume
        A file in which an interrupted estimate continues; it is written as the sampler proceeds.

    Returns
    -------
    LumpMap
        Lumps with intervals, probabilities, unevenness, blind zone and next places.

    Raises
    ------
    InputError
        When a press does not fit the probe, or too few remain.
    NotCalibratedError
        When frames come without calibration, or it is another probe's.
    """
    raise NotImplementedError
