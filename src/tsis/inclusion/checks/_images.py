"""What the pictures themselves say against an estimate: no contact, clipping, a cropped face, no round press."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.imaging import rough_contact
from tsis.inclusion._frames import ring_edges
from tsis.inclusion.checks._roundness import roundness_findings, tilt_findings
from tsis.inclusion.checks._sectors import ring_visibility, sector_means
from tsis.model import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.inclusion.checks._sectors import Sectors
    from tsis.model import Calibration, Probe, TactileImage


FAINT = 3.0  # of one pixel's noise without light: a background drifts by as much
LIT_RINGS = 4  # a third of the radius that profiles are read from: less shows a spot and no profile
EVEN = 5.0  # standard deviations of the chi-square of an even picture
LEAST_LIT = 0.2  # of what the force should light
LEAST_VISIBLE_FRACTION = 0.5  # of each ring of the inner half of the disc that profiles are read from
MISSING = 1e-3  # share of that disc that may be missing without a word


def image_findings(
    targets: Sequence[TactileImage],
    references: Sequence[TactileImage],
    *,
    probe: Probe,
    calibration: Calibration,
) -> list[tuple[str, str]]:
    """Check frames that belong together: refuse what shows no press, and say what else speaks against them.

    Parameters
    ----------
    targets, references
        Frames as the camera delivered them, of one camera, with ``force_n`` and ``mm_per_pixel``.
    probe
        What pressed.
    calibration
        Answer of grey level to pressure and the sizes of the errors.

    Returns
    -------
    Flags and their sentences: ``saturated``, ``cropped``, ``tilted``, ``not_one_round_inclusion``,
    ``roundness_not_checked``.

    Raises
    ------
    InputError
        When a frame shows no press, or much of the inner face lies outside the picture.
    """
    frames = [*targets, *references]
    cropped = cropped_findings(frames[0], probe)
    shown = [sector_means(frame, probe=probe, calibration=calibration) for frame in frames]
    for frame, sectors in zip(frames, shown, strict=True):
        check_contact(frame, sectors, probe=probe, calibration=calibration)
    reference = shown[len(targets) :]
    nearest = [_nearest(target, references, reference) for target in targets]
    return [
        *saturated_findings(frames, shown),
        *cropped,
        *tilt_findings(reference, calibration),
        *roundness_findings(shown[: len(targets)], nearest, calibration),
    ]


def _nearest(target: TactileImage, references: Sequence[TactileImage], sectorses: Sequence[Sectors]) -> Sectors | None:
    """The reference of the force nearest to that of the target."""
    if not references:
        return None
    difference = [abs((reference.force_n or 0.0) - (target.force_n or 0.0)) for reference in references]
    return sectorses[int(np.argmin(difference))]


def check_contact(frame: TactileImage, sectors: Sectors, *, probe: Probe, calibration: Calibration) -> None:
    """Refuse a frame that shows no press, or one so light that hardly anything is lit.

    Raises
    ------
    InputError
        When fewer than four rings stand out of the background, the grey is even over the face to within the noise of
        its pixels, or it is less than a fifth of what the mean pressure of ``force_n`` should light.
    """
    label, count = frame.name or "an image", sectors.grid.count
    level = (sectors.raw * count).sum(axis=1) / np.maximum(count.sum(axis=1), 1) - calibration.background_grey
    noise = float(np.sqrt(calibration.read_noise_grey**2 + 1 / 12))
    if np.count_nonzero(level > FAINT * noise) < LIT_RINGS:
        raise InputError(
            f"images must show a press that lights at least {LIT_RINGS} of {len(level)} rings of the face; {label!r} "
            f"shows {level.max():.2g} grey levels above the background of {calibration.background_grey:g} in the "
            f"brightest, where a pixel's noise is {noise:.2g}: press harder, or check the lamps and background_grey"
        )
    mean = float((sectors.raw * count).sum() / count.sum())
    square = float((count * (sectors.raw - mean) ** 2 / sectors.pixel_variance).sum())
    if square <= count.size + EVEN * np.sqrt(2.0 * count.size):
        raise InputError(
            f"images must show a press; {label!r} is even over the face, {mean:.3g} grey levels with no more than "
            "noise: check contact, lamps and exposure"
        )
    lit = float((level * count.sum(axis=1)).sum() / sectors.grid.light.sum())
    pressure = MN_PER_N * (frame.force_n or 0.0) / (np.pi * probe.radius_mm**2)
    expected = float(rough_contact(np.array([pressure]), calibration)[0])
    if lit < LEAST_LIT * expected:
        raise InputError(
            f"images must be as bright as their force lights them; {label!r} shows {lit:.2g} grey levels at even light "
            f"where {frame.force_n:g} N should light about {expected:.2g}: check contact, force_n, exposure and "
            "calibration"
        )


def saturated_findings(frames: Sequence[TactileImage], shown: Sequence[Sectors]) -> list[tuple[str, str]]:
    """Flag ``saturated`` with the largest share of clipped pixels inside the disc that profiles are read from."""
    fractions = [float(item.clipped.sum() / item.grid.count.sum()) for item in shown]
    worst = int(np.argmax(fractions))
    if fractions[worst] == 0.0:
        return []
    frame = frames[worst]
    return [
        (
            "saturated",
            f"{100 * fractions[worst]:.2g} % of the pixels that the profile is read from clip at "
            f"{frame.full_scale:g} in "
            f"{frame.name or 'an image'!r}: expose shorter or press less.",
        )
    ]


def cropped_findings(frame: TactileImage, probe: Probe) -> list[tuple[str, str]]:
    """Flag ``cropped`` with the share of the disc that lies outside the picture.

    Raises
    ------
    InputError
        When more than half of a ring in the inner half of the disc lies outside.
    """
    edges = ring_edges(probe)
    observed = ring_visibility(frame, edges)
    inner = observed[: len(observed) // 2]
    if inner.min() < LEAST_VISIBLE_FRACTION:
        ring = int(np.argmin(inner))
        raise InputError(
            f"the picture must hold at least half of every ring of the inner face; it holds {100 * inner[ring]:.0f} % "
            f"of the one from {edges[ring]:.2g} to {edges[ring + 1]:.2g} mm: check mm_per_pixel and axis_px, or centre "
            "the probe in the picture"
        )
    area = np.diff(edges**2)
    missing = float(1 - (observed * area).sum() / area.sum())
    if missing <= MISSING:
        return []
    return [
        (
            "cropped",
            f"{100 * missing:.2g} % of the disc of {edges[-1]:.2g} mm that the profile is read from lies outside the "
            "picture: rings are seen in part, and what is not centred biases them.",
        )
    ]
