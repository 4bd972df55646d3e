"""Checks of the images: no contact, clipping, a cropped face, a press that is not round."""

from __future__ import annotations

from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.imaging.rendering import rough_contact
from tsis.inclusion.checks.roundness import roundness_findings, tilt_findings
from tsis.inclusion.checks.sectors import ring_visibility, sector_means
from tsis.inclusion.flags import CROPPED, CROPPED_FRACTION, SATURATED
from tsis.inclusion.frames import ring_edges
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.inclusion.checks.sectors import Sectors
    from tsis.inclusion.checks.unevenness import FieldHarmonics
    from tsis.inclusion.prior import Complexes
    from tsis.model.calibration import Calibration
    from tsis.model.flag import Finding
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


FAINT = 3.0  # of a pixel's noise without light: drift of the background
LIT_RINGS = 4  # a third of the profile's radius: fewer rings give no profile
EVEN = 5.0  # standard deviations of the chi-square of a uniform picture
LEAST_LIT = 0.2  # of the light expected for the force
# Light over that expected, between presses; 210 of the benchmarks' worlds differed by at most 1.31 (0.5 to 1 N, dome).
MOST_UNLIKE, MOST_UNLIKE_AT_ONE_FORCE = 2.0, 1.4
ONE_FORCE = 0.02  # relative difference
UNLIT = 3.0  # grey levels
EACH = 4  # every fourth pixel tells how bright a frame is
LEAST_VISIBLE_FRACTION = 0.5  # of each ring of the inner half of the profile's disc


def image_findings(
    targets: Sequence[TactileImage],
    references: Sequence[TactileImage],
    *,
    probe: Probe,
    calibration: Calibration,
    uneven: FieldHarmonics | None = None,
) -> list[Finding]:
    """Check the frames of a target: refuse frames without a press, and flag other defects.

    Parameters
    ----------
    targets, references
        Raw frames of one camera, with ``force_n`` and ``mm_per_pixel``.
    probe
        The probe that pressed.
    calibration
        Response of grey level to pressure, and the errors.
    uneven
        Harmonics by uneven tissue, which are no defect; None for even tissue.

    Returns
    -------
    Flags and their messages: ``saturated``, ``cropped``, ``tilted``, ``not_one_round_inclusion``,
    ``roundness_not_checked``.

    Raises
    ------
    InputError
        When a frame shows no press, or much of the inner face lies outside the picture.
    """
    frames = [*targets, *references]
    cropped = cropped_findings(frames[0], probe)
    means = [sector_means(frame, probe=probe, calibration=calibration) for frame in frames]
    for frame, sectors in zip(frames, means, strict=True):
        check_contact(frame, sectors, probe=probe, calibration=calibration)
    nearest = [_nearest(target, references) for target in targets]
    first = len(targets)

    def allowed(order: int, *places: int | None) -> list[Complexes]:
        """Harmonics of the frames at ``places`` by uneven tissue, which differs between sites."""
        causes: list[Complexes] = []
        for place in places:
            if uneven is not None and place is not None:
                columns = uneven.columns(order, means[place], frames[place].force_n or 0.0)
                causes += [part * column for column in columns.T for part in (1, 1j)]
        return causes

    pairs = [None if near is None else first + near for near in nearest]
    return [
        *saturated_findings(frames, means),
        *cropped,
        *tilt_findings(means[first:], calibration, [allowed(1, place) for place in range(first, len(frames))]),
        *roundness_findings(
            means[:first],
            [None if place is None else means[place] for place in pairs],
            calibration,
            [allowed(2, *both) for both in enumerate(pairs)],
        ),
    ]


def _nearest(target: TactileImage, references: Sequence[TactileImage]) -> int | None:
    """Index of the reference with the nearest force."""
    if not references:
        return None
    difference = [abs((reference.force_n or 0.0) - (target.force_n or 0.0)) for reference in references]
    return int(np.argmin(difference))


def check_contact(frame: TactileImage, sectors: Sectors, *, probe: Probe, calibration: Calibration) -> None:
    """Refuse a frame that lights fewer than four rings, is uniform within the noise, or is too dark for its force.

    Too dark is less than a fifth of the level expected for the mean pressure of ``force_n``.
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
            f"images must show a press; {label!r} is uniform over the face, {mean:.3g} grey levels within the noise: "
            "check contact, lamps and exposure"
        )
    lit = float((level * count.sum(axis=1)).sum() / sectors.grid.light.sum())
    pressure = MN_PER_N * (frame.force_n or 0.0) / (np.pi * probe.radius_mm**2)
    expected = float(rough_contact(np.array([pressure]), calibration)[0])
    if lit < LEAST_LIT * expected:
        raise InputError(
            f"images must be as bright as expected for their force; {label!r} shows {lit:.2g} grey levels at uniform "
            f"light where {frame.force_n:g} N should give about {expected:.2g}: check contact, force_n, exposure and "
            "calibration"
        )


def require_forces_as_lit(frames: Sequence[TactileImage], *, probe: Probe, calibration: Calibration) -> None:
    """Refuse presses of which one is far brighter for its force than another: forces were mixed up.

    ``frames`` are raw presses with ``force_n`` on one kind of place, of one size, scale and axis.
    """
    if len(frames) < 2:
        return
    (x, y), (scale_x, scale_y), (rows, columns) = frames[0].axis(), frames[0].scale(), frames[0].grey.shape
    across, down = scale_x * (np.arange(0, columns, EACH) - x), scale_y * (np.arange(0, rows, EACH) - y)
    disc = np.hypot(across, down[:, None]) < ring_edges(probe)[-1]
    pressed = []  # of frames with a press; what is wrong with the others is said elsewhere
    for frame in frames:
        level = float(frame.grey[::EACH, ::EACH][disc].mean()) - calibration.background_grey
        if frame.force_n and level > UNLIT:
            pressure = MN_PER_N * frame.force_n / (np.pi * probe.radius_mm**2)
            pressed.append((frame, frame.force_n, level / float(rough_contact(np.array([pressure]), calibration)[0])))
    for (one, force, bright), (other, other_force, dim) in permutations(pressed, 2):
        alike = abs(force - other_force) <= ONE_FORCE * force
        if bright > (MOST_UNLIKE_AT_ONE_FORCE if alike else MOST_UNLIKE) * dim:
            raise InputError(
                f"images must be as bright as expected for their forces; {one.name or 'an image'!r} at {force:g} N "
                f"shows {bright / dim:.2g} times as much of it as {other.name or 'another'!r} at {other_force:g} N: "
                "check which force belongs to which image"
            )


def saturated_findings(frames: Sequence[TactileImage], means: Sequence[Sectors]) -> list[Finding]:
    """Flag ``saturated`` with the largest fraction of clipped pixels inside the profile's disc."""
    fractions = [float(sectors.clipped.sum() / sectors.grid.count.sum()) for sectors in means]
    worst = int(np.argmax(fractions))
    if fractions[worst] == 0.0:
        return []
    frame = frames[worst]
    percent, name = 100 * fractions[worst], frame.name or "an image"
    return [SATURATED.finding(percent=percent, full_scale=frame.full_scale, frame=name)]


def cropped_findings(frame: TactileImage, probe: Probe) -> list[Finding]:
    """Flag ``cropped`` with the fraction of the disc outside the picture; refuse less than half of an inner ring."""
    edges = ring_edges(probe)
    visible = ring_visibility(frame, edges)
    inner = visible[: len(visible) // 2]
    if inner.min() < LEAST_VISIBLE_FRACTION:
        ring = int(np.argmin(inner))
        raise InputError(
            f"the picture must show at least half of each ring of the inner face; it shows {100 * inner[ring]:.0f} % "
            f"of the ring from {edges[ring]:.2g} to {edges[ring + 1]:.2g} mm: check mm_per_pixel and axis_px, or "
            "centre the probe in the picture"
        )
    area = np.diff(edges**2)
    missing = float(1 - (visible * area).sum() / area.sum())
    if missing <= CROPPED_FRACTION:
        return []
    return [CROPPED.finding(percent=100 * missing, radius_mm=edges[-1])]
