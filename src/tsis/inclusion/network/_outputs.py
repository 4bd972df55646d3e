"""The three outputs of a press of section 6.3, greatest value, total and area, of frames and of simulated presses.

The source evaluates the whole face. With a flat face and a fixed force the outputs are then nearly equal for all
inclusions: the total is the force, the area is the face, and the greatest value is at the rim. By default the reference
press is subtracted and the rim is excluded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.imaging import radial_profile
from tsis.inclusion._frames import pixels_mm
from tsis.inclusion._prior import PARAMETERS, Floats
from tsis.inclusion.posterior import ring_means
from tsis.mechanics.surrogate import PressSurrogate
from tsis.model import (
    Calibration,
    Probe,
    as_images,
    require_array,
    require_image_series,
    require_number,
    require_one_of,
    require_type,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from tsis.model import TactileImage


OUTPUTS = ("greatest", "total", "area")
FIELDS = ("face_displacement_mm", "pressure_kpa")
OUTPUT_RADIUS_MM = 8.0  # beyond it the rim of a 12 mm face is brighter than the inclusion
RINGS = 20
MOST_RINGS = 1000
CHUNK = 4096  # profiles refined at a time: 26 MB with the usual rings
BRIGHTEST = 0.999  # of saturation, the limit of the inverse response
FINE = 40  # radii per ring that resolve the area's outline to 0.3 % of its radius
CHANGED_FRACTION = 0.05  # of the reference's mean: a change that counts as deformed, above errors of force
PRESSED_FRACTION = 0.5  # of the reference's mean: level that counts as deformed without subtraction


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputReading:
    """Definition of the three outputs of ring profiles; created by `change_reading` or `printed_reading`.

    Attributes
    ----------
    edges_mm
        Ring boundaries on the face, shape (rings + 1,).
    subtract
        Whether the reference press is subtracted.
    threshold_share
        Level above which the face counts as deformed, over the mean level of the reference, in [1e-6, 10].
    """

    edges_mm: Floats
    subtract: bool
    threshold_share: float

    def __post_init__(self) -> None:
        edges = require_array("edges_mm", self.edges_mm, ndim=1)
        if not 3 <= len(edges) <= MOST_RINGS + 1 or edges[0] < 0 or (np.diff(edges) <= 0).any():
            raise InputError(
                f"edges_mm must be 3 to {MOST_RINGS + 1} ascending radii, the first >= 0; "
                f"got {len(edges)} from {edges[0]:g} to {edges[-1]:g}"
            )
        object.__setattr__(self, "edges_mm", edges)
        require_number("threshold_share", self.threshold_share, 1e-6, 10.0)

    def __call__(self, profiles: ArrayLike, reference: ArrayLike) -> Floats:
        """Greatest, total and area (mm²), shape (n, 3), of profiles (n, rings) beside that of plain tissue (rings,)."""
        values, base = require_array("profiles", profiles, ndim=2), require_array("reference", reference, ndim=1)
        rings = len(self.edges_mm) - 1
        if values.shape[1] != rings or base.shape != (rings,):
            raise InputError(f"profiles and reference must have {rings} rings; got {values.shape} and {base.shape}")
        area = np.pi * np.diff(self.edges_mm**2)
        level = self.threshold_share * float(base @ area) / float(area.sum())
        if self.subtract:
            values = values - base
        return np.column_stack([values.max(axis=1), values @ area, self._area_above(values, level)])

    def _area_above(self, values: Floats, level: float) -> Floats:
        """Area where profiles exceed a level, from parabolas through the ring means."""
        middles = np.sqrt((self.edges_mm[1:] ** 2 + self.edges_mm[:-1] ** 2) / 2)
        ends = np.linspace(self.edges_mm[0], self.edges_mm[-1], FINE * len(middles) + 1)
        inside = np.clip((ends[1:] + ends[:-1]) / 2, middles[0], middles[-1])
        area = np.pi * np.diff(ends**2)
        parts = np.array_split(values, len(values) // CHUNK + 1)
        return np.concatenate(
            [(scipy.interpolate.PchipInterpolator(middles, part, axis=1)(inside) > level) @ area for part in parts]
        )


def change_reading(
    *, extent_mm: float = OUTPUT_RADIUS_MM, threshold_fraction: float = CHANGED_FRACTION
) -> OutputReading:
    """Outputs of the change against the reference, without the rim.

    Parameters
    ----------
    extent_mm
        Radius on the face, mm, in [0.1, 200].
    threshold_fraction
        Change that counts as deformed, over the reference's mean.

    Raises
    ------
    InputError
        When a number lies outside its range.
    """
    extent = require_number("extent_mm", extent_mm, 0.1, 200.0, hint="millimetres")
    return OutputReading(
        edges_mm=np.linspace(0.0, extent, RINGS + 1), subtract=True, threshold_share=threshold_fraction
    )


def printed_reading(probe: Probe, *, threshold_fraction: float = PRESSED_FRACTION) -> OutputReading:
    """Outputs of the whole face without subtraction, as in section 6.3.

    Parameters
    ----------
    probe
        The probe, whose face is evaluated from the axis to the rim.
    threshold_fraction
        Grey level that counts as deformed, over the reference's mean.

    Raises
    ------
    InputError
        When ``probe`` is no `Probe`, or the fraction is out of range.
    """
    require_type("probe", probe, Probe)
    edges = np.linspace(0.0, probe.radius_mm, RINGS + 1)
    return OutputReading(edges_mm=edges, subtract=False, threshold_share=threshold_fraction)


def simulated_outputs(
    surrogate: PressSurrogate,
    inclusions: ArrayLike,
    reading: OutputReading,
    *,
    field: str = "face_displacement_mm",
    tissue_young_kpa: float = 5.0,
    thickness_mm: float = 30.0,
) -> Floats:
    """The three outputs of simulated presses; section 6.3.1.

    Parameters
    ----------
    surrogate
        Presses of the probe at one force.
    inclusions
        Diameter (mm), depth (mm) and modulus (kPa) of each, shape (n, 3), inside the surrogate's box.
    reading
        Definition of the outputs.
    field
        ``"face_displacement_mm"`` as in the source, or ``"pressure_kpa"``, which a camera measures.
    tissue_young_kpa, thickness_mm
        The slab around the inclusion, inside the surrogate's box.

    Returns
    -------
    Outputs of shape (n, 3): mm, mm³ and mm², or kPa, mN and mm².

    Raises
    ------
    InputError
        When a value is outside the surrogate's box or the reading extends beyond the face.
    UnknownNameError
        When the field is unknown.
    """
    require_type("surrogate", surrogate, PressSurrogate)
    require_type("reading", reading, OutputReading)
    require_one_of("field", field, FIELDS)
    table, box = require_array("inclusions", inclusions, ndim=2), surrogate.pressure_kpa.box
    if table.shape[1] != len(PARAMETERS):
        raise InputError(f"inclusions must have the columns {', '.join(PARAMETERS)}; got shape {table.shape}")
    for name, column in zip(PARAMETERS, table.T, strict=True):
        for end in (column.min(), column.max()):
            require_number(name, float(end), *getattr(box, name), hint="the surrogate's box")
    require_number("tissue_young_kpa", tissue_young_kpa, *box.tissue_young_kpa, hint="the surrogate's box")
    require_number("thickness_mm", thickness_mm, *box.thickness_mm, hint="the surrogate's box")
    require_number(
        "the reading's extent", reading.edges_mm[-1], 0.0, float(surrogate.radius_mm[-1]), hint="the face, mm"
    )
    rings = getattr(surrogate, field).mapped(ring_means(surrogate.radius_mm, reading.edges_mm))
    at = rings.at_tissue(tissue_young_kpa, thickness_mm)
    return reading(at(*table.T), at.baseline)


def printed_frame_outputs(images: TactileImage | Sequence[TactileImage], *, threshold_grey: float) -> Floats:
    """The outputs as section 6.3.2 prints them, of raw frames.

    Parameters
    ----------
    images
        Frames of the pressed probe.
    threshold_grey
        Grey level above which a pixel counts as deformed, in [0, 65535]; the source's k, which it does not give.

    Returns
    -------
    Grey level at the centroid, sum of grey levels, and number of pixels above the threshold; shape (n, 3).

    Raises
    ------
    InputError
        When there is no frame, or a frame is dark and has no centroid.

    Examples
    --------
    >>> from tsis.model import TactileImage
    >>> printed_frame_outputs(TactileImage(grey=[[0.0, 2.0, 0.0], [2.0, 9.0, 2.0]]), threshold_grey=5.0).tolist()
    [[9.0, 15.0, 1.0]]
    """
    threshold = require_number("threshold_grey", threshold_grey, 0.0, 65535.0, hint="grey levels")
    frames = as_images("images", images)
    if not frames:
        raise InputError("images must hold a frame at least; got none")
    return np.array([_printed(frame, threshold) for frame in frames])


def _printed(frame: TactileImage, threshold: float) -> tuple[float, float, float]:
    grey, total = frame.grey, float(frame.grey.sum())
    if not total > 0:
        raise InputError(f"every frame must hold light; {frame.name or 'an image'!r} sums to {total:g} grey levels")
    rows, columns = np.indices(grey.shape)
    row, column = round(float((rows * grey).sum()) / total), round(float((columns * grey).sum()) / total)
    row, column = min(max(row, 0), grey.shape[0] - 1), min(max(column, 0), grey.shape[1] - 1)  # negative noise
    return float(grey[row, column]), total, float(np.count_nonzero(grey > threshold))


def frame_outputs(
    images: TactileImage | Sequence[TactileImage],
    reference: TactileImage,
    reading: OutputReading,
    *,
    calibration: Calibration,
) -> Floats:
    """The three outputs of frames, in grey levels at uniform light; section 6.3.2.

    Parameters
    ----------
    images
        Frames of the pressed probe over inclusions, of known force and scale.
    reference
        Reference press of the same force.
    reading
        Definition of the outputs.
    calibration
        Background and light map.

    Returns
    -------
    Outputs of shape (n, 3): grey levels, grey levels times mm², and mm².

    Raises
    ------
    InputError
        When a force or scale is unknown, forces differ, or a ring is outside the picture or completely clipped.
    ImageMismatchError
        When the frames differ in size, scale or axis.
    """
    rings = _rings_of_frames(images, reference, reading, calibration)
    return reading(rings[:-1], rings[-1])


def pressure_outputs(
    images: TactileImage | Sequence[TactileImage],
    reference: TactileImage,
    reading: OutputReading,
    *,
    calibration: Calibration,
) -> Floats:
    """The three outputs of frames in the units of the simulated pressure, by the response of the calibration.

    Parameters
    ----------
    images, reference, reading, calibration
        As for `frame_outputs`.

    Returns
    -------
    Outputs of shape (n, 3): kPa, mN and mm², as `simulated_outputs` has them of ``"pressure_kpa"``.

    Raises
    ------
    InputError, ImageMismatchError
        As `frame_outputs`.
    """
    grey = _rings_of_frames(images, reference, reading, calibration)
    fraction = grey / (calibration.gain_grey_per_kpa * calibration.saturation_kpa)
    slope = np.sqrt(np.pi) / 2.0  # of the error function's argument, so that the gain is the slope at no pressure
    rings = calibration.saturation_kpa / slope * scipy.special.erfinv(np.clip(fraction, -BRIGHTEST, BRIGHTEST))
    return reading(rings[:-1], rings[-1])


def _rings_of_frames(
    images: TactileImage | Sequence[TactileImage],
    reference: TactileImage,
    reading: OutputReading,
    calibration: Calibration,
) -> Floats:
    """Ring means in grey levels at uniform light of each frame, the reference last; shape (n + 1, rings)."""
    require_type("calibration", calibration, Calibration)
    require_type("reading", reading, OutputReading)
    frames = [*as_images("images", images), *as_images("reference", reference)]
    if len(frames) < 2:
        raise InputError(f"images must hold a frame at least, beside the reference; got {len(frames) - 1}")
    require_image_series(frames)
    forces = {frame.force_n for frame in frames}
    if len(forces) > 1:
        raise InputError(f"force_n must be the same for all frames; got {sorted(str(force) for force in forces)}")
    rings = np.array([_ring_means(frame, reading.edges_mm, calibration) for frame in frames])
    unseen = int(np.isnan(rings).any(axis=0).sum())
    if unseen:
        raise InputError(
            f"every ring to {reading.edges_mm[-1]:g} mm must have lit pixels in the picture that are not clipped; "
            f"got {unseen} of {rings.shape[1]} rings without (lower the exposure or the extent)"
        )
    return rings


def _ring_means(frame: TactileImage, edges_mm: Floats, calibration: Calibration) -> Floats:
    """Mean grey above the background in rings, at uniform light; NaN in rings without usable pixels.

    Clipped pixels are excluded, since the press is round. The sum of grey over the sum of light is, with photon noise,
    the best mean.
    """
    light: NDArray[np.floating[Any]] = np.ones(frame.grey.shape)
    if calibration.light is not None:
        light = calibration.light.at(*pixels_mm(frame))
    clipped = frame.grey >= frame.full_scale
    lit = replace(frame, grey=np.where(clipped, frame.full_scale, light))  # excludes the same pixels
    observed, light_there = (radial_profile(item, edges_mm=edges_mm).mean_grey for item in (frame, lit))
    return np.asarray((observed - calibration.background_grey) / np.where(light_there > 0, light_there, np.nan))
