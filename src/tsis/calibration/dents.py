"""Light on a dented face, fitted with gain and contact law.

Gain, contact law and change of the light by a dent appear as a product. Each alone stays uncertain, but pads flatten
the face as tissue does, so their product is known where presses on tissue need it. The joint covariance tells so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import CalibrationError
from tsis.imaging.rendering import rough_contact
from tsis.mechanics import press
from tsis.model.calibration import (
    BEND_TERMS,
    FLUX_TERMS,
    GROWTH_TERMS,
    LIGHT_REACH,
    LIGHT_RINGS,
    LIGHT_TERMS,
    LightMap,
    LightTerms,
)
from tsis.model.phantom import Phantom
from tsis.model.press import MN_PER_N
from tsis.model.require import require_number
from tsis.optics.angles import ERF_SLOPE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.force_line import Loading
    from tsis.model.calibration import Calibration
    from tsis.model.press import PressField
    from tsis.model.probe import Probe

    Floats = NDArray[np.float64]
    Integers = NDArray[np.intp]


PAD_THICKNESS_MM, PAD_POISSON = 30.0, 0.49
LEAST_PAD_N = 0.15  # lighter presses dent the face too little
LEAST_PRESSURE = 0.3  # of the largest in a ring; rings with less may be touched in part
FEWEST_PRESSES = 3
PAD_LIGHT_SD = 0.01  # light from pad to pad, relative, as from tip to tip
FRAME_SD, STRAY_SD = 0.003, 0.003  # force of a frame, and stray light over the frame's mean, relative
MODEL_SD = 0.003  # of a ring: mesh, pattern of the probe
LAW_SD, LAW_RINGS = 0.01, 5.0  # what no term describes, the same in all presses; it varies over so many rings
LEFT_PER_MM = 0.0075  # of the log light by each term of the growth: what differs between presses and no term describes
PROBE_SD = 0.03  # of the probe's moduli, which acts as an error of the pads'
STEP = 0.05  # of the log modulus of a pad, for its derivative
DEEPEST_TIP_MM = 0.8  # dents of tips that second order describes
TIP_SD, TIP_ZERO_N = 0.05, 0.004  # of the sum under a tip: Hertz on layers, light from tip to tip; zero of the gauge
# Usual lamps around a soft probe: standard deviations of the terms, the log gain of the tips among them
GROWTH_PER_MM, FLUX = 0.25, 0.5 * LIGHT_REACH
GROWTH_SD, BEND_SD, FLUX_SD, LOSS_SD, SQUARE_SD, GAIN_SD = 0.25, 0.5, 0.75 * LIGHT_REACH, 0.02, 1.5e-3, 1.5
# Of a press on tissue, relative: drift of the gain since the calibration, and unknown light or force
GAIN_DRIFT_SD, LEAST_FORCE_SD = 0.01, 0.01
LEFT_SD = 0.05  # relative error of the log change from pads to tissue: what no term describes
STRAIGHT_KPA = 1000.0  # saturation above which contact counts as straight
GRID = 33  # points along each side of the map
STEEPNESS = ERF_SLOPE**2 / 3  # of rough contact: 1 - STEEPNESS (p / saturation)**2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PadPresses:
    """Presses of the probe on one soft flat pad.

    Parameters
    ----------
    young_kpa
        Modulus of the pad.
    force_n
        Forces, shape (n,).
    grey
        Mean corrected grey level of `LIGHT_RINGS` rings of equal width out to `LIGHT_REACH` of the face's radius, shape
        (n, rings); NaN where nothing can be read.
    variance
        Of the rings by the noise of the pixels, same shape.
    """

    young_kpa: float
    force_n: Floats
    grey: Floats
    variance: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DentLight:
    """Light and gain of a probe on soft objects.

    Attributes
    ----------
    response
        The calibration for presses on tissue, with the map of the light and its joint covariance with the gain.
    misfit
        Root mean square residual of the rings over its expected size.
    displacement_mm
        Largest displacement of the face in these presses: the light is known up to there.
    gain_ratio, gain_sd
        The gain over that of the tips, and its relative standard deviation.
    product_sd
        Relative standard deviation of the light of the strongest press on a pad, mean over the face.
    presses
        Number of presses on pads in the fit.
    """

    response: Calibration
    misfit: float
    displacement_mm: float
    gain_ratio: float
    gain_sd: float
    product_sd: float
    presses: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rows:
    """Log of grey over contact, its derivatives by the unknowns, and its covariance, for the rings of one press."""

    residual: Floats
    terms: Floats  # shape (rows, unknowns)
    covariance: Floats
    rings: Integers  # of `LIGHT_RINGS`, none for a tip


def ring_edges_mm(probe: Probe) -> Floats:
    """Boundaries of the rings of `PadPresses`."""
    return np.linspace(0.0, LIGHT_REACH * probe.radius_mm, LIGHT_RINGS + 1)


def fit_dent_light(
    pads: Sequence[PadPresses],
    loadings: Sequence[Loading],
    *,
    probe: Probe,
    response: Calibration,
    pixel_mm2: float,
    pad_sd: float = 0.05,
    strain: str = "finite",
) -> DentLight:
    """Fit growth, bend and flux of the light, the light that contact takes, contact law and gain to all presses.

    Raises `CalibrationError` when the pads have fewer than three readable presses.

    Parameters
    ----------
    pads
        Presses on one pad or more, best of two moduli near those of tissue.
    loadings
        Loadings by the tips; presses with dents below 0.8 mm count.
    probe
        The probe, which gives pressure and displacement under the pads.
    response
        Response by the tips alone, the start of the fit.
    pixel_mm2
        Area of a pixel on the face.
    pad_sd
        Relative standard deviation of the pads' moduli, in [0.001, 0.5].
    strain
        Mechanics of the presses on pads, as in `tsis.mechanics.press`.
    """
    require_number("pad_sd", pad_sd, 0.001, 0.5, hint="a fraction of 1")
    presses = [
        (number, pad, at)
        for number, pad in enumerate(pads)
        for at in np.flatnonzero(pad.force_n >= LEAST_PAD_N)
        if np.isfinite(pad.grey[at]).any()
    ]
    if len(presses) < FEWEST_PRESSES:
        raise CalibrationError(
            f"the light on dents needs at least {FEWEST_PRESSES} presses on pads from {LEAST_PAD_N:g} N on; got "
            f"{len(presses)} (press a soft pad at several forces)"
        )
    count, deepest, law = LIGHT_TERMS + 2 * len(pads) + LIGHT_RINGS, 0.0, _law_root()
    rows, strongest = [], np.zeros((1, count))
    for number, pad, at in presses:
        force = float(pad.force_n[at])
        states = [_pressed(probe, pad.young_kpa * float(np.exp(step)), force, strain) for step in (0.0, STEP)]
        row = _rows_of_pad(pad, int(at), states, response)
        if not len(row.residual):
            continue
        terms = np.zeros((len(row.residual), count))
        terms[:, :LIGHT_TERMS] = row.terms[:, :-1]
        terms[:, LIGHT_TERMS + 2 * number] = row.terms[:, -1]
        terms[:, LIGHT_TERMS + 2 * number + 1] = 1.0
        terms[:, -LIGHT_RINGS:] = law[row.rings]
        rows.append(replace(row, terms=terms))
        if states[0][1].max() > deepest:
            deepest, strongest = float(states[0][1].max()), terms
    if not rows:
        raise CalibrationError("the pads must touch the face; no ring of it shows their light (press harder)")
    tips = _rows_of_tips(loadings, probe, response, pixel_mm2, count)
    mean, sd = _usual()
    nuisance_sd = np.tile([float(np.hypot(pad_sd, PROBE_SD)), PAD_LIGHT_SD], len(pads))
    spread = np.concatenate([sd, nuisance_sd, np.ones(LIGHT_RINGS)])
    start = np.concatenate([mean, np.zeros(count - LIGHT_TERMS)])
    solution, covariance, misfit = _solved(rows + tips, start, spread)
    covariance[:GROWTH_TERMS, :GROWTH_TERMS] += LEFT_PER_MM**2 * np.eye(GROWTH_TERMS)
    joint = strongest[:, :LIGHT_TERMS] @ covariance[:LIGHT_TERMS, :LIGHT_TERMS] @ strongest[:, :LIGHT_TERMS].T
    return DentLight(
        response=_response(
            solution[:LIGHT_TERMS],
            covariance[:LIGHT_TERMS, :LIGHT_TERMS],
            _left(rows, np.concatenate([solution[:-LIGHT_RINGS], np.zeros(LIGHT_RINGS)])),
            probe,
            response,
        ),
        misfit=misfit,
        displacement_mm=deepest,
        gain_ratio=float(np.exp(solution[LIGHT_TERMS - 1])),
        gain_sd=float(np.sqrt(covariance[LIGHT_TERMS - 1, LIGHT_TERMS - 1])),
        product_sd=float(np.sqrt(np.mean(np.diag(joint)))),
        presses=len(presses),
    )


def _usual() -> tuple[Floats, Floats]:
    """Mean and standard deviation of the coefficients for usual lamps."""
    mean = np.zeros(LIGHT_TERMS)
    mean[0], mean[GROWTH_TERMS + BEND_TERMS] = GROWTH_PER_MM, FLUX
    growth, bend, flux = (
        sd * np.minimum(1.0, 3.0 / np.arange(1, terms + 1)) ** 2  # lamps vary smoothly along the radius
        for sd, terms in ((GROWTH_SD, GROWTH_TERMS), (BEND_SD, BEND_TERMS), (FLUX_SD, FLUX_TERMS))
    )
    return mean, np.concatenate([growth, bend, flux, [LOSS_SD, SQUARE_SD, GAIN_SD]])


def _law_root() -> Floats:
    """Root of the covariance of the rings' common errors; without them, many presses would seem to know the law."""
    apart = np.subtract.outer(np.arange(LIGHT_RINGS), np.arange(LIGHT_RINGS)) / LAW_RINGS
    values, vectors = np.linalg.eigh(LAW_SD**2 * np.exp(-(apart**2) / 2))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _pressed(probe: Probe, young_kpa: float, force_n: float, strain: str) -> tuple[Floats, Floats, Floats]:
    """Mean pressure, displacement and slope of each ring under a pad."""
    pad = Phantom(young_kpa=young_kpa, poisson=PAD_POISSON, thickness_mm=PAD_THICKNESS_MM)
    field: PressField = press(probe, pad, force_n=force_n, strain=strain)
    edges = ring_edges_mm(probe)
    x, weight = np.polynomial.legendre.leggauss(6)
    radius = edges[:-1, None] + np.diff(edges)[:, None] / 2 * (x + 1)
    area = radius * weight
    slope = np.gradient(field.face_displacement_mm, field.radius_mm)
    pressure, displacement, tilt = (
        (np.interp(radius, field.radius_mm, part) * area).sum(axis=1) / area.sum(axis=1)
        for part in (field.pressure_kpa, field.face_displacement_mm, slope)
    )
    return pressure, displacement, tilt


def _terms(pressure: Floats, displacement: Floats, slope: Floats, force_n: float) -> Floats:
    """Derivatives of the log light of each ring by the coefficients, shape (rings, `LIGHT_TERMS`)."""
    unit = LightTerms.of(np.eye(LIGHT_TERMS))
    return np.asarray(
        displacement[:, None] * unit.growth_per_mm
        + displacement[:, None] ** 2 * unit.bend_per_mm2
        + slope[:, None] * unit.flux
        - force_n * unit.loss_per_n
        - pressure[:, None] ** 2 * unit.square_per_kpa2
        + unit.log_gain
    )


def _rows_of_pad(pad: PadPresses, at: int, states: list[tuple[Floats, Floats, Floats]], response: Calibration) -> _Rows:
    """The rings of one press on a pad that it touches wholly; the last term is the log modulus of the pad."""
    (pressure, displacement, slope), (stiffer, further, steeper) = states
    grey, force = pad.grey[at], float(pad.force_n[at])
    good = (pressure > LEAST_PRESSURE * pressure.max()) & (np.nan_to_num(grey) > 0)
    expected, changed = (rough_contact(np.maximum(part, 1e-6), response) for part in (pressure, stiffer))
    terms = _terms(pressure, displacement, slope, force)
    moved = (_terms(stiffer, further, steeper, force) - terms) @ _usual()[0]
    by_modulus = (np.log(changed / expected) + moved) / STEP
    good &= np.isfinite(by_modulus)
    light = grey[good]
    stray = light.mean() / light if good.any() else light
    noise = pad.variance[at, good] / light**2 + MODEL_SD**2
    return _Rows(
        residual=np.log(light / expected[good]),
        terms=np.column_stack([terms, by_modulus])[good],
        covariance=np.diag(noise) + FRAME_SD**2 + STRAY_SD**2 * np.outer(stray, stray),
        rings=np.flatnonzero(good),
    )


def _rows_of_tips(
    loadings: Sequence[Loading], probe: Probe, response: Calibration, pixel_mm2: float, count: int
) -> list[_Rows]:
    """Sums of grey levels under the tips in shallow dents, over the force, weighted by Hertz's pressure."""
    rows, edges = [], ring_edges_mm(probe)
    radius, area = (edges[:-1] + edges[1:]) / 2, np.diff(edges**2)
    for loading in loadings:
        good = loading.touched & loading.rising & (loading.mean_square_mm2 > 0) & (loading.clipped == 0)
        for at in np.flatnonzero(good & (loading.total_grey > 0) & (loading.load_n > 0)):
            square, force = 2.5 * float(loading.mean_square_mm2[at]), float(loading.load_n[at])
            if square / loading.tip_radius_mm > DEEPEST_TIP_MM:
                continue
            weight = area * np.sqrt(np.maximum(1 - radius**2 / square, 0.0))
            if np.count_nonzero(weight) < 3:
                continue
            sunk, tilt = (square - radius**2 / 2) / loading.tip_radius_mm, -radius / loading.tip_radius_mm
            peak = 1.5 * force * MN_PER_N / (np.pi * square)
            pressure = peak * np.sqrt(np.maximum(1 - radius**2 / square, 0.0))
            terms = np.zeros((1, count))
            terms[0, :LIGHT_TERMS] = weight @ _terms(pressure, sunk, tilt, force) / weight.sum()
            gain = float(loading.total_grey[at]) * pixel_mm2 / (force * MN_PER_N)
            rows.append(
                _Rows(
                    residual=np.array([np.log(gain / response.gain_grey_per_kpa)]),
                    terms=terms,
                    covariance=np.array([[TIP_SD**2 + (TIP_ZERO_N / force) ** 2]]),
                    rings=np.array([], dtype=int),
                )
            )
    return rows


def _solved(rows: list[_Rows], start: Floats, sd: Floats) -> tuple[Floats, Floats, float]:
    """Mean, covariance and misfit of the unknowns; a misfit above 1 widens the covariance of the data."""
    widened = 1.0
    for _ in range(2):
        information, pull = np.diag(sd**-2.0), np.zeros(len(sd))
        for row in rows:
            weighted = np.linalg.solve(widened**2 * row.covariance, row.terms)
            information += row.terms.T @ weighted
            pull += weighted.T @ (row.residual - row.terms @ start)
        covariance = np.linalg.inv(information)
        solution = start + covariance @ pull
        left = [row.residual - row.terms @ solution for row in rows]
        square = sum(float(part @ np.linalg.solve(row.covariance, part)) for part, row in zip(left, rows, strict=True))
        prior = float((covariance / np.outer(sd, sd)).trace())
        freedom = max(sum(map(len, left)) - (len(sd) - prior), 1.0)
        misfit = float(np.sqrt(square / freedom))
        if widened > 1 or misfit <= 1:
            break
        widened = misfit
    return solution, (covariance + covariance.T) / 2, misfit


def _left(rows: list[_Rows], solution: Floats) -> Floats:
    """Log light of each ring that the terms leave in the mean of the presses on pads, shape (`LIGHT_RINGS`,)."""
    total, count = np.zeros((2, LIGHT_RINGS))
    for row in rows:
        total[row.rings] += row.residual - row.terms @ solution
        count[row.rings] += 1
    seen = np.flatnonzero(count)
    return np.interp(np.arange(LIGHT_RINGS), seen, total[seen] / count[seen])


def _response(mean: Floats, covariance: Floats, left: Floats, probe: Probe, response: Calibration) -> Calibration:
    """The calibration for presses on tissue."""
    growth, bend, flux, (loss, square, gain) = np.split(mean, np.cumsum([GROWTH_TERMS, BEND_TERMS, FLUX_TERMS]))
    side = np.linspace(-probe.radius_mm, probe.radius_mm, GRID)
    distance = np.hypot(side, side[:, None])
    ring = np.minimum(distance, LIGHT_REACH * probe.radius_mm) / (LIGHT_REACH * probe.radius_mm) * LIGHT_RINGS
    legendre = np.polynomial.legendre.legvander(
        np.clip(2 * (ring - 0.5) / (LIGHT_RINGS - 1) - 1, -1.0, 1.0), GROWTH_TERMS - 1
    )
    outwards = ring / (LIGHT_RINGS - 0.5) * (legendre[..., :FLUX_TERMS] @ flux) / np.maximum(distance, 1e-9)
    steeper = STEEPNESS / response.saturation_kpa**2 + float(square)
    saturation = float(np.sqrt(STEEPNESS / max(steeper, STEEPNESS / STRAIGHT_KPA**2)))
    area = np.pi * probe.radius_mm**2
    values, vectors = np.linalg.eigh(covariance)
    return replace(
        response,
        gain_grey_per_kpa=response.gain_grey_per_kpa * float(np.exp(gain)),
        gain_sd=GAIN_DRIFT_SD,
        force_sd=max(response.force_sd, LEAST_FORCE_SD),
        saturation_kpa=saturation,
        light=LightMap(
            x_mm=side,
            y_mm=side,
            relative=np.exp(np.interp(ring - 0.5, np.arange(LIGHT_RINGS), left)),
            flux_x=outwards * side,
            flux_y=outwards * side[:, None],
            growth_per_mm=legendre @ growth,
            bend_per_mm2=legendre[..., :BEND_TERMS] @ bend,
            error=0.0,
            depletion=float(np.clip(float(loss) * area * saturation / MN_PER_N, -0.9, 100.0)),
            factor=vectors * np.sqrt(np.maximum(values, 0.0)),
        ),
        shading_sd=LEFT_SD,
    )
