"""What a scan measured: rows in kPa, their noise and nuisances."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError, NotCalibratedError
from tsis.files.cache import cached_arrays, content_key
from tsis.inclusion.checks.sectors import RINGS, SECTORS, harmonic, harmonic_noise, sector_means
from tsis.inclusion.estimation import check_calibration
from tsis.inclusion.frames import OUTER_FRACTION
from tsis.inclusion.posterior.rings import ring_means
from tsis.mapping.scan import LARGEST_FORCE_N, LEAST_FORCE_N, first_few
from tsis.mapping.signals import DIAMETERS_MM, LEAST_KPA, SHAPES, SignalTable
from tsis.mapping.uneven_field import FieldResponses
from tsis.mechanics.lump_kernel import finite_strain_kernel, lump_kernel
from tsis.mechanics.mesh import mechanical_content
from tsis.mechanics.surrogate.correction_building import build_finite_correction
from tsis.mechanics.surrogate.finite_correction import tissue_box, wide_box
from tsis.mechanics.tissue_field import FieldMesh, TissueFieldResponse
from tsis.model.press import MN_PER_N
from tsis.optics.angles import ERF_SLOPE

if TYPE_CHECKING:
    from tsis.inclusion.prior import Booleans, Complexes, Integers
    from tsis.mapping.prior import MapPrior
    from tsis.mapping.scan import Scan, ScanPress
    from tsis.mapping.signals import Floats
    from tsis.mechanics.surrogate.finite_correction import CorrectionBox, FiniteCorrection
    from tsis.model.calibration import Calibration
    from tsis.model.probe import Probe


TABLE_VERSION = 1
TILT_SD_DEG = 1.0
OFFSET_SD, GAIN_SD, FORCE_SD = 0.01, 0.01, 0.01  # relative, where no calibration states them
UNKNOWN_FORCE_SD = 0.5
STEP = 0.02  # of logarithms of modulus and thickness, for derivatives
POINTS = 25  # radii of the profiles
REPEATABILITY = 1e-3  # of the mean pressure, beside the stated noise
LEAST_PLACE_SD_MM = 0.03
LEAST_READ_FORCE_N = 0.01  # a press of unknown force whose pressures amount to less has no contact
NO_CONTACT = 0.1  # of the stated force, to which the pressures amount where the probe did not touch
WRONG_UNIT = 4.0  # a ratio of pressures and force that no tissue has: the next unit is a factor of 7 or more away
FINITE_POISSON = 0.49  # of the tables of finite strain
# Of a lump's signal, for each unit of force over modulus times radius squared: what the correction by finite strain,
# which is that of lumps on the axis, leaves of presses beside a lump in three dimensions
FINITE_ERROR = 0.15
ITERATIONS = 6  # of the force that pressures amount to
LEAST_SPAN = 0.5  # of the face's radius: places nearer together than that are in another unit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observation:
    """The used presses of a scan as numbers.

    Attributes
    ----------
    table
        Signals of lumps.
    field
        Responses to uneven tissue.
    values
        Measured numbers less those of even tissue without lump, shape (presses, numbers).
    own
        Covariance of the numbers of each press by its noise and its own nuisances, (presses, numbers, numbers).
    shared
        What all presses share beside lumps and uneven tissue, one standard deviation a column, (presses, numbers,
        columns).
    white
        Variance of each number by noise alone, shape (presses, numbers).
    places_mm, place_sd_mm, angle, force_n
        Of each press; angle in radians.
    reference
        Whether each press is known to be without lump under it.
    radius_mm
        Radius of the face.
    index
        Index of each used press in the scan.
    left_out
        A sentence for each press that is not used.
    scale_kpa
        Mean pressure of a press.
    strain_error
        Of a lump's signal in each press, alike in all: what the correction by finite strain leaves; 0 at small strain.
    """

    table: SignalTable
    field: FieldResponses
    values: Floats
    own: Floats
    shared: Floats
    white: Floats
    places_mm: Floats
    place_sd_mm: Floats
    angle: Floats
    force_n: Floats
    reference: Booleans
    radius_mm: float
    index: Integers
    left_out: tuple[str, ...]
    scale_kpa: float
    strain_error: Floats

    @property
    def noise(self) -> Floats:
        """Covariance of all numbers but for lumps and uneven tissue."""
        columns = self.shared.reshape(self.values.size, -1)
        return np.asarray(scipy.linalg.block_diag(*self.own) + columns @ columns.T)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EvenSlab:
    """One probe on even tissue, seen in rings."""

    table: SignalTable
    field: FieldResponses
    bare: Floats  # ring means of the press, (parts, rings)
    by_thickness: Floats  # derivative by the logarithm of the thickness, (parts, rings)
    tilt: Floats  # harmonic 1 per radian, (rings,)
    finite: FiniteCorrection | None  # of the ring means without lump; None at small strain
    tissue: tuple[float, float]  # modulus in kPa, thickness in mm

    def even(self, force_n: float, *, stiffer: float = 0.0, thicker: float = 0.0) -> Floats:
        """Ring means of a press; the logarithms of modulus and thickness change those at finite strain alone."""
        return np.asarray(force_n * self.bare[0] + self.bare[1] + self._added(force_n, stiffer, thicker))

    def _added(self, force_n: float, stiffer: float = 0.0, thicker: float = 0.0) -> Floats:
        """What finite strain adds to the ring means."""
        if self.finite is None:
            return np.zeros_like(self.bare[0])
        young, thickness = self.tissue[0] * np.exp(stiffer), self.tissue[1] * np.exp(thicker)
        return np.asarray(self.finite.without_inclusion(np.array([[young, thickness, force_n]]))[0])

    def force_n(self, round_kpa: Floats) -> float:
        """Force to which ring means of the pressure amount, in newtons."""
        weight, force = np.arange(len(round_kpa)) + 0.5, 0.0
        for _ in range(1 if self.finite is None else ITERATIONS):
            rest = round_kpa - self.bare[1] - (self._added(force) if force > 0 else 0.0)
            force = float((weight * rest).sum() / (weight * self.bare[0]).sum())
        return force


@lru_cache(maxsize=4)
def _slab(
    probe: Probe,
    young_kpa: float,
    thickness_mm: float,
    poisson: float,
    rings: int,
    harmonics: int,
    ranges: CorrectionBox | None,
) -> EvenSlab:
    """``ranges`` are those of the correction by finite strain; None at small strain."""
    kernel = lump_kernel(probe, young_kpa=young_kpa, thickness_mm=thickness_mm, poisson=poisson)
    edges = np.linspace(0.0, OUTER_FRACTION * probe.radius_mm, rings + 1)
    finite = None
    if ranges is not None:
        correction = build_finite_correction(probe, ranges=ranges)
        kernel = finite_strain_kernel(kernel, probe, correction, young_kpa=young_kpa)
        means = ring_means(correction.radius_mm, edges)
        to_rings = np.hstack([means, np.zeros_like(means)])  # of the pressures, not of the displacements
        finite = correction.mapped(to_rings, to_rings)
    rows = ring_means(kernel.radius_mm, edges)
    key = content_key(
        {
            "version": TABLE_VERSION,
            "probe": mechanical_content(probe),
            "tissue": [young_kpa, thickness_mm, poisson],
            "rings": [rings, harmonics, list(SHAPES), DIAMETERS_MM.tolist(), LEAST_KPA],
        }
    )
    table = SignalTable.stored(
        kernel, cached_arrays("lump-table", key, lambda: SignalTable.of(kernel, rows, harmonics).arrays())
    )
    mesh = FieldMesh(points=POINTS)

    def of(thickness: float) -> TissueFieldResponse:
        return TissueFieldResponse(probe, young_kpa=young_kpa, thickness_mm=thickness, poisson=poisson, mesh=mesh)

    slab = of(thickness_mm)
    bare = slab.press()[0] @ rows.T
    by_thickness = (of(thickness_mm * np.exp(STEP)).press()[0] @ rows.T - bare) / STEP
    return EvenSlab(
        table=table,
        field=FieldResponses(slab, table.shapes, rows, displacement_rows=None, force_n=1.0),
        bare=bare,
        by_thickness=by_thickness,
        tilt=rows @ slab.tilt()[0],
        finite=finite,
        tissue=(young_kpa, thickness_mm),
    )


def finite_ranges(probe: Probe, prior: MapPrior) -> CorrectionBox:
    """Ranges of the table of finite strain that covers a prior, that of the larger forces first."""
    tables = (tissue_box(probe), wide_box(probe))
    for ranges in tables:
        pairs = (
            (ranges.diameter_mm, prior.diameter_mm),
            (ranges.depth_mm, prior.depth_mm),
            (ranges.contrast, prior.contrast),
            (ranges.tissue_young_kpa, (prior.tissue_young_kpa,) * 2),
            (ranges.thickness_mm, (prior.thickness_mm,) * 2),
        )
        if prior.poisson == FINITE_POISSON and all(own[0] <= low and high <= own[1] for own, (low, high) in pairs):
            return ranges
    wide = tables[-1]
    raise InputError(
        f"prior must lie within diameter_mm {wide.diameter_mm}, depth_mm {wide.depth_mm}, contrast {wide.contrast}, "
        f"tissue_young_kpa {wide.tissue_young_kpa}, thickness_mm {wide.thickness_mm} and poisson {FINITE_POISSON} for "
        f"strain 'finite'; got {prior}: narrow the prior, or press lightly and map at strain 'small'"
    )


def _require_forces(presses: list[ScanPress], forces: list[float], slab: EvenSlab) -> None:
    """`InputError` for a force outside the table of finite strain."""
    if slab.finite is None:
        return
    least, most = slab.finite.forces_n(*slab.tissue)
    for press, force in zip(presses, forces, strict=True):
        if not least <= force <= most:
            raise InputError(
                f"force_n must lie between {np.ceil(100 * least) / 100:g} and {np.floor(100 * most) / 100:g} N for "
                f"strain 'finite' on tissue of {slab.tissue[0]:g} kPa; got {force:.3g} N for "
                f"{press.name or press.place_mm!r}: press at a force in between, or, on tissue of 3 to 8.4 kPa, give a "
                "prior of lumps of 1 to 15 mm, 4 to 12 mm deep and at most 22 times as stiff, whose table reaches "
                "farther"
            )


def observe(
    scan: Scan, probe: Probe, calibration: Calibration | None, prior: MapPrior, *, strain: str = "small"
) -> Observation:
    """Numbers of the presses of a probe; presses that cannot be used are named."""
    ranges = finite_ranges(probe, prior) if strain == "finite" else None
    if scan.kind == "frame":
        if calibration is None:
            raise NotCalibratedError("calibration must be given for frames: their grey levels are no pressures without")
        check_calibration(calibration, probe)
    used, left_out = _usable(scan)
    harmonics, rings, sectors = _resolution(scan, used)
    slab = _slab(probe, prior.tissue_young_kpa, prior.thickness_mm, prior.poisson, rings, harmonics, ranges)
    shapes = slab.table.shapes
    read = {index: _harmonics(scan.presses[index], probe, calibration, harmonics, sectors) for index in used}
    forces_read = {index: slab.force_n(measured[0].real) for index, (measured, _) in read.items()}
    used, idle = _in_contact(scan, forces_read)
    left_out += idle
    require_places([scan.presses[index].place_mm for index in used], probe.radius_mm, left_out)
    presses = [scan.presses[index] for index in used]
    values, blocks, forces, force_sds = [], [], [], []
    for index, press in zip(used, presses, strict=True):
        measured, variance = read[index]
        force, sd = _force(press, calibration, forces_read[index])
        expected = np.zeros_like(measured)
        expected[0] = slab.even(force)
        level = REPEATABILITY * float(np.abs(expected[0]).mean())
        values.append(shapes.reduced(measured - expected))
        blocks.append(shapes.noise(variance + level**2))
        forces.append(force)
        force_sds.append(sd)
    _require_forces(presses, forces, slab)
    pushes: Floats = np.array(forces)
    shared, own = _nuisances(slab, pushes, np.array(force_sds), calibration, prior, rings)
    return Observation(
        table=slab.table,
        field=slab.field,
        values=np.array(values),
        own=np.array(blocks) + own @ own.swapaxes(1, 2),
        shared=shared,
        white=np.array([np.diag(block) for block in blocks]),
        places_mm=np.array([press.place_mm for press in presses]),
        place_sd_mm=np.array([max(press.place_sd_mm, LEAST_PLACE_SD_MM) for press in presses]),
        angle=np.radians([press.angle_deg for press in presses]),
        force_n=pushes,
        reference=np.array([press.reference for press in presses]),
        radius_mm=probe.radius_mm,
        index=np.array(used),
        left_out=tuple(left_out),
        scale_kpa=float(np.abs(slab.even(float(pushes.mean()))).mean()),
        strain_error=_strain_error(pushes, probe, prior) * (strain == "finite"),
    )


def _strain_error(force_n: Floats, probe: Probe, prior: MapPrior) -> Floats:
    unit_n = prior.tissue_young_kpa * probe.radius_mm**2 / MN_PER_N
    return FINITE_ERROR * force_n / unit_n


def _usable(scan: Scan) -> tuple[list[int], list[str]]:
    used: list[int] = []
    left_out = list(scan.left_out)
    seen: set[tuple[object, ...]] = set()
    for index, press in enumerate(scan.presses):
        name = press.name or f"press {index + 1}"
        force = press.measured_force_n
        if force is not None and force < LEAST_FORCE_N:
            left_out.append(f"{name} has no contact: its force is {force:g} N.")
        elif (key := (press.place_mm, press.angle_deg, force)) in seen and _same(scan, used, press):
            left_out.append(f"{name} repeats another press: same place and same values.")
        else:
            used.append(index)
            seen.add(key)
    require_places([scan.presses[index].place_mm for index in used], 0.0, left_out)
    return used, left_out


def require_places(places: list[tuple[float, float]], radius_mm: float, left_out: list[str]) -> None:
    """`InputError` for fewer than two places, or places all within a part of the radius of what pressed."""
    if len(set(places)) < 2:
        raise InputError(f"presses must hold at least two usable places; {first_few(left_out) or 'got one'}")
    span = float(np.ptp(places, axis=0).max())
    if span < LEAST_SPAN * radius_mm:
        raise InputError(
            f"place_mm must span at least {LEAST_SPAN * radius_mm:g} mm, half the radius of what pressed; got "
            f"{span:.3g} mm: give x_mm and y_mm in millimetres, or press farther apart"
        )


def _in_contact(scan: Scan, forces_read: dict[int, float]) -> tuple[list[int], list[str]]:
    """Presses whose pressures amount to a force, and a sentence for each other one.

    `InputError` where the pressures of the median press do not amount to the force that is stated.
    """
    used, read = list(forces_read), np.array(list(forces_read.values()))
    stated = np.array([scan.presses[index].measured_force_n or np.nan for index in used])
    known = ~np.isnan(stated)
    if known.any():
        middle = np.flatnonzero(known)[np.argsort((read / stated)[known])[known.sum() // 2]]
        if not 1 / WRONG_UNIT < read[middle] / stated[middle] < WRONG_UNIT:
            raise InputError(
                f"force_n must fit the pressures; those of the median press amount to {read[middle]:.3g} N, and "
                f"{stated[middle]:.3g} N is stated: check the units (kPa, N), the probe and its calibration"
            )
    if float(np.median(read)) > LARGEST_FORCE_N:
        raise InputError(
            f"pressure_kpa must be of presses of at most {LARGEST_FORCE_N:g} N; those of the median press amount to "
            f"{np.median(read):.3g} N: check the unit (kPa) and the probe"
        )
    unknown = max(float(np.median(read)), LEAST_READ_FORCE_N / NO_CONTACT)
    idle = read < NO_CONTACT * np.where(known, stated, unknown)
    names = [scan.presses[index].name or f"press {index + 1}" for index in used]
    return [index for index, without in zip(used, idle, strict=True) if not without], [
        f"{name} has no contact: its pressures amount to {force:.2g} N."
        for name, force, without in zip(names, read, idle, strict=True)
        if without
    ]


def _same(scan: Scan, used: list[int], press: ScanPress) -> bool:
    for index in used:
        other = scan.presses[index]
        if other.place_mm == press.place_mm:
            for name in ("pressure_kpa", "travel_force"):
                first, second = getattr(other, name), getattr(press, name)
                if first is not None and second is not None and np.array_equal(first, second):
                    return True
            if (
                other.frame is not None
                and press.frame is not None
                and np.array_equal(other.frame.grey, press.frame.grey)
            ):
                return True
    return False


def _resolution(scan: Scan, used: list[int]) -> tuple[int, int, int]:
    """Harmonics, rings and sectors of the presses, which must agree."""
    if scan.kind == "frame":
        return len(SHAPES), RINGS, SECTORS
    shapes = {scan.presses[index].pressure_kpa.shape: scan.presses[index].name for index in used}  # type: ignore[union-attr]
    if len(shapes) > 1:
        got = " and ".join(f"{shape} in {name or 'a press'}" for shape, name in sorted(shapes.items()))
        raise InputError(f"pressure_kpa must have one shape, (rings, sectors), in all presses; got {got}")
    shape = next(iter(shapes))
    sectors = shape[1] if len(shape) == 2 else 1
    return min(len(SHAPES), (sectors - 1) // 2 + 1), shape[0], sectors


def _harmonics(
    press: ScanPress, probe: Probe, calibration: Calibration | None, harmonics: int, sectors: int
) -> tuple[Complexes, Floats]:
    """Harmonics of the pressure in kPa, complex (harmonics, rings), and the variance of each part."""
    if press.frame is not None:
        return _of_frame(press, probe, calibration, harmonics)  # type: ignore[arg-type]
    means = np.asarray(press.pressure_kpa).reshape(-1, sectors)
    angle = (np.arange(sectors) + 0.5) * (2 * np.pi / sectors)
    values, variance = np.zeros((harmonics, len(means)), dtype=complex), np.zeros((harmonics, len(means)))
    for order in range(harmonics):
        gain = (1.0 if order == 0 else 2.0) / sectors / np.sinc(order / sectors)
        values[order] = gain * (means @ np.exp(1j * order * angle))
        variance[order] = press.noise_kpa**2 * gain**2 * sectors * (1.0 if order == 0 else 0.5)
    return values, variance


def _of_frame(press: ScanPress, probe: Probe, calibration: Calibration, harmonics: int) -> tuple[Complexes, Floats]:
    if press.frame is None:
        raise AssertionError("only called for frames")
    sectors = sector_means(press.frame, probe=probe, calibration=calibration)
    if not sectors.usable.all():
        ring = int(np.flatnonzero(~sectors.usable)[0])
        raise InputError(
            f"frame must show all rings without clipping; ring {ring + 1} of {RINGS} of "
            f"{press.name or press.place_mm!r} does not: check mm_per_pixel, axis_px and the exposure"
        )
    top = calibration.gain_grey_per_kpa * calibration.saturation_kpa
    share = np.clip(sectors.grey / top, -0.98, 0.98)
    pressure = calibration.saturation_kpa / ERF_SLOPE * scipy.special.erfinv(share)
    slope = calibration.gain_grey_per_kpa * np.exp(-((ERF_SLOPE * pressure / calibration.saturation_kpa) ** 2))
    variance = sectors.variance / slope**2
    values, noise = [pressure.mean(axis=1).astype(complex)], [variance.mean(axis=1) / SECTORS]
    for order in range(1, harmonics):
        values.append(harmonic(pressure, order))
        noise.append(harmonic_noise(variance, order).mean(axis=0))
    return np.array(values), np.array(noise)


def _force(press: ScanPress, calibration: Calibration | None, read_n: float) -> tuple[float, float]:
    """Force in newtons and its relative standard deviation; that read off the pressures where it is unknown."""
    force = press.measured_force_n
    if force is not None:
        known = FORCE_SD if calibration is None else calibration.force_sd
        return force, known if press.force_sd is None else press.force_sd
    return max(read_n, LEAST_FORCE_N), UNKNOWN_FORCE_SD


def _nuisances(
    slab: EvenSlab,
    force: Floats,
    force_sd: Floats,
    calibration: Calibration | None,
    prior: MapPrior,
    rings: int,
) -> tuple[Floats, Floats]:
    """What moves the numbers beside lumps and uneven tissue, one standard deviation a column.

    First what all presses share, then what each has of its own; both (presses, numbers, columns).
    """
    shapes = slab.table.shapes

    def numbers(round_part: Floats, order: int = 0, side: int = 0) -> Floats:
        result = np.zeros((len(shapes.basis), rings), dtype=complex)
        result[order] = round_part * (1j if side else 1.0)
        return shapes.reduced(result)

    even = [slab.even(push) for push in force]
    each = [numbers(rings_of) for rings_of in even]
    stiffer = slab.field.uniform()
    gain_sd = GAIN_SD if calibration is None else calibration.gain_sd
    offset_sd = OFFSET_SD if calibration is None else calibration.offset_sd
    by_thickness = numbers(slab.by_thickness[0])
    pattern = [] if calibration is None else _pattern(calibration, rings)
    shared, single = [], []
    for press, push in enumerate(force):
        by_modulus, by_height = (
            numbers((slab.even(push, **{name: STEP}) - even[press]) / STEP) for name in ("stiffer", "thicker")
        )  # of what finite strain adds
        shared.append(
            [
                gain_sd * each[press],
                prior.tissue_young_sd * (push * stiffer + by_modulus),
                prior.thickness_sd * (push * by_thickness + by_height),
                *(numbers(one * even[press]) for one in pattern),
            ]
        )
        mean = float(even[press].mean())
        parts = [
            numbers(force_sd[press] * (slab.even(push * (1 + STEP)) - even[press]) / STEP),
            numbers(np.full(rings, offset_sd * mean)),
        ]
        if len(shapes.basis) > 1:
            parts += [numbers(np.radians(TILT_SD_DEG) * slab.tilt, 1, side) for side in (0, 1)]
        single.append(parts)
    return np.array(shared).swapaxes(1, 2), np.array(single).swapaxes(1, 2)


def _pattern(calibration: Calibration, rings: int) -> list[Floats]:
    """Errors of the light that all presses share: pattern, and dents where they were not measured."""
    width = np.linspace(-1.0, 1.0, rings)
    sd = calibration.pattern_sd if calibration.light is not None else max(calibration.pattern_sd, 0.02)
    return [sd * np.polynomial.legendre.legval(width, np.eye(4)[term]) for term in range(1, 4)]
