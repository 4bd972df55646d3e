"""Ring profiles of grey level as a function of inclusion and nuisances.

Nuisances, all normal with mean 0: log gain (shared), log tissue modulus, log slab thickness, log modulus of the
reference site over the target's, log modulus of the probe's layers, Poisson's ratio less the prior's, the square of the
inclusion's distance from the axis less its estimate, emphasis of the shading, for each frame log force and a constant
offset, and the further errors of the shading.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.imaging.rendering import rough_contact, rough_contact_slope
from tsis.inclusion.posterior.rings import OUTPUTS_PER_RING, TERMS

if TYPE_CHECKING:
    from tsis.inclusion.posterior.rings import RingResponses, RingShading
    from tsis.inclusion.posterior.uneven_tissue import Heterogeneity
    from tsis.inclusion.prior import Booleans, Floats, InclusionPrior
    from tsis.mechanics.surrogate.finite_correction import FiniteCorrection
    from tsis.mechanics.surrogate.polynomial import TissueSurrogate
    from tsis.model.calibration import Calibration


GAIN, TISSUE, THICKNESS, SITE, PROBE, POISSON, SPREAD = range(7)
SHADE, SHARED = slice(7, 7 + TERMS), 7 + TERMS
SHARED_NUISANCES = ("gain", "tissue", "thickness", "site", "probe", "poisson", "spread", *TERMS * ("shade",))
STEP = 1e-3  # of log moduli and log thickness, for derivatives


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForwardModel:
    """Grey profiles, at uniform light, of a set of frames.

    Attributes
    ----------
    rings
        Pressure, displacement and slope of each ring under any force that presses the whole face.
    level
        Light of each ring of the undeformed face, shape (rings,): the grey level of stray light over it is a constant.
    shading
        Effect of displacement and slope on the light of each ring.
    calibration, prior
        Response of grey level to pressure; tissue around the inclusion.
    force_n
        Force of each frame, shape (frames,).
    is_reference
        Whether each frame is a reference press, shape (frames,).
    correlation
        Correlation of the patterns between rings, shape (rings, rings); None for independent rings.
    depletion_per_n
        Light falls by ``1 / (1 + depletion_per_n * force)``, because the contact area, which extracts light, grows with
        the force.
    spread_sd
        Standard deviation in mm**2 of the square of the inclusion's distance from the axis.
    heterogeneity
        Hypotheses on how uneven the tissue is; None for even tissue.
    correction
        What finite strain adds to the rings' responses; None for small strain.
    """

    rings: RingResponses
    level: Floats
    shading: RingShading
    calibration: Calibration
    prior: InclusionPrior
    force_n: Floats
    is_reference: Booleans
    correlation: Floats | None = None
    depletion_per_n: float = 0.0
    spread_sd: float = 0.0
    heterogeneity: Heterogeneity | None = None
    correction: FiniteCorrection | None = None

    def nuisance_sd(self, mean_grey: Floats) -> Floats:
        """Prior standard deviations of the nuisances; ``mean_grey`` (frames,) scales the offsets."""
        errors = self.calibration
        shared = [
            errors.gain_sd,
            self.prior.tissue_young_sd,
            self.prior.thickness_sd,
            errors.site_sd,
            errors.probe_young_sd,
            self.prior.poisson_sd,
            self.spread_sd,
            *TERMS * [errors.shading_sd],
        ]
        forces = np.full(len(self.force_n), errors.force_sd)
        return np.concatenate([shared, forces, errors.offset_sd * mean_grey, np.ones(self.shading.uncertainty.count)])

    def grey(self, inclusions: Floats | None, nuisance: Floats) -> Floats:
        """Grey profiles, shape (n, frames, rings), of inclusions (n, 3) of diameter, depth and modulus.

        None is tissue without inclusion, n = 1.
        """
        presses = {reference: self._press(inclusions, nuisance, reference=reference) for reference in self._shown()}
        count = 1 if inclusions is None else len(inclusions)
        grey = np.empty((count, len(self.force_n), self.rings.count))
        finite = self._finite(inclusions, nuisance)
        for frame, (push, offset) in enumerate(self._pushes(nuisance)):
            press = self.rings.under(push, presses[bool(self.is_reference[frame])]) + finite[frame]
            pressure, displacement, slope = _parts(press)
            shade = self.shading.factor(displacement, slope, nuisance[SHADE], self._errors(nuisance))
            light = rough_contact(pressure, self.calibration) * shade * self._bent(pressure, nuisance)
            grey[:, frame] = np.exp(nuisance[GAIN]) * self._remaining(push, nuisance) * light + offset / self.level
        return grey

    def profiles(self, inclusions: Floats | None, nuisance: Floats) -> tuple[Floats, Floats]:
        """Grey profiles and their derivatives by the nuisances.

        Parameters
        ----------
        inclusions
            Diameter, depth and modulus, shape (n, 3); None for tissue without inclusion, n = 1.
        nuisance
            Point of linearisation, shape (nuisances,).

        Returns
        -------
        Grey levels, shape (n, frames, rings), and derivatives, shape (n, frames, rings, nuisances).
        """
        frames, count = len(self.force_n), 1 if inclusions is None else len(inclusions)
        grey = np.empty((count, frames, self.rings.count))
        slopes = np.zeros((*grey.shape, len(nuisance)))
        presses = {reference: self._press(inclusions, nuisance, reference=reference) for reference in self._shown()}
        changes = {
            reference: self._changes(inclusions, nuisance, presses[reference], reference=reference)
            for reference in self._shown()
        }
        finite, bends = self._finite_changes(inclusions, nuisance)
        for frame, (push, offset) in enumerate(self._pushes(nuisance)):
            reference, remaining = bool(self.is_reference[frame]), self._remaining(push, nuisance)
            gain = np.exp(nuisance[GAIN]) * remaining
            press = self.rings.under(push, presses[reference]) + finite[frame]
            light, by_answer, by_shade, by_errors = self._light(press, nuisance)
            grey[:, frame] = gain * light + offset / self.level
            slopes[:, frame, :, GAIN] = gain * light
            for name, change in changes[reference].items():
                slopes[:, frame, :, name] = gain * _along(
                    by_answer, self.rings.under(push, change) + bends[name][frame]
                )
            slopes[:, frame, :, SHADE] = gain * by_shade
            by_force = push * self.rings.per_newton(presses[reference]) + bends[SHARED][frame]
            unknown = self.shading.uncertainty
            by_loss = push * unknown.by_force
            lost = push * self.depletion_per_n / (1 + self.depletion_per_n * push) + by_loss @ self._errors(nuisance)
            slopes[:, frame, :, SHARED + frame] = gain * (_along(by_answer, by_force) - lost * light)
            slopes[:, frame, :, SHARED + frames + frame] = 1 / self.level
            slopes[:, frame, :, SHARED + 2 * frames :] = gain * (
                by_errors + light[..., None] * (unknown.by_gain - by_loss)
            )
        return grey, slopes

    def tissue_columns(self, about: Floats | None, nuisance: Floats) -> tuple[Floats, Floats]:
        """Factors of the covariance of the grey profiles by uneven tissue and by a layer of unit standard deviation.

        ``about`` is the inclusion (3,) at the target site, or None. The shapes are (lengths, frames * rings, columns),
        where the two sites have columns of their own, and (frames * rings, layers), which they have in common.
        """
        if self.heterogeneity is None:
            raise AssertionError("only called for uneven tissue")
        shown, layers = sorted(self._shown()), self.heterogeneity.layer_count
        changes = {reference: self.heterogeneity.responses(None if reference else about) for reference in shown}
        last = np.cumsum([changes[reference].shape[1] - layers for reference in shown]).tolist()
        columns = np.zeros((len(changes[shown[0]]), len(self.force_n), self.rings.count, last[-1] + layers))
        inclusions = None if about is None else about[None]
        presses = {reference: self._press(inclusions, nuisance, reference=reference) for reference in shown}
        finite = self._finite(inclusions, nuisance)
        for frame, (push, _) in enumerate(self._pushes(nuisance)):
            reference = bool(self.is_reference[frame])
            gain = np.exp(nuisance[GAIN]) * self._remaining(push, nuisance)
            press = self.rings.under(push, presses[reference]) + finite[frame]
            _, by_answer, _, _ = self._light(press, nuisance)
            change = np.swapaxes(gain * _along(by_answer, self.rings.under(push, changes[reference])), 1, 2)
            end = last[shown.index(reference)]
            columns[:, frame, :, end - change.shape[2] + layers : end] = change[..., :-layers]
            columns[:, frame, :, last[-1] :] = change[..., -layers:]
        columns = columns.reshape(len(columns), -1, columns.shape[-1])
        return columns[..., :-layers], columns[0, :, -layers:]

    def bounds(self) -> tuple[Floats, Floats]:
        """Range of each nuisance in which the model can be linearised.

        The surrogate ends somewhere; reference site and probe move the tissue a little beyond, where its polynomials
        still hold. In two nuisances the model is linear, which at 0 saves evaluating them.
        """
        high = np.full(SHARED + 2 * len(self.force_n) + self.shading.uncertainty.count, np.inf)
        low = -high
        box = self.rings.response.box
        for place, ends, middle in (
            (TISSUE, box.tissue_young_kpa, self.prior.tissue_young_kpa),
            (THICKNESS, box.thickness_mm, self.prior.thickness_mm),
        ):
            low[place], high[place] = np.log(np.array(ends) / middle)
        for place in (POISSON, SPREAD):
            low[place] = high[place] = 0.0
        return low, high

    def table(self, nuisance: Floats) -> TissueSurrogate:
        """The surrogate's table at these nuisances: the profiles of its inclusions determine all others."""
        return self.rings.response.at_tissue(
            self.prior.tissue_young_kpa * float(np.exp(nuisance[TISSUE])),
            self.prior.thickness_mm * float(np.exp(nuisance[THICKNESS])),
        )

    def _remaining(self, force_n: float, nuisance: Floats) -> float:
        """Fraction of the light after extraction by contact, times the error of a gain measured with the light."""
        unknown, errors = self.shading.uncertainty, self._errors(nuisance)
        lost, gained = float(unknown.by_force @ errors), float(unknown.by_gain @ errors)
        return float(np.exp(gained - lost * force_n)) / (1 + self.depletion_per_n * force_n)

    def _errors(self, nuisance: Floats) -> Floats:
        """The further errors of the shading."""
        return nuisance[SHARED + 2 * len(self.force_n) :]

    def _shown(self) -> set[bool]:
        return set(self.is_reference.tolist())

    def _pushes(self, nuisance: Floats) -> list[tuple[float, float]]:
        """Force in newtons and offset in grey levels of each frame."""
        frames = len(self.force_n)
        force = self.force_n * np.exp(nuisance[SHARED : SHARED + frames])
        return list(zip(force.tolist(), nuisance[SHARED + frames : SHARED + 2 * frames].tolist(), strict=True))

    def _press(self, inclusions: Floats | None, nuisance: Floats, *, reference: bool) -> Floats:
        """Ring responses to a press, (n, outputs), on the target or on the tissue of the reference site."""
        shown = None if reference else inclusions
        press = self._at(nuisance[TISSUE] + reference * nuisance[SITE], nuisance[THICKNESS], nuisance[PROBE], shown)
        if not nuisance[[POISSON, SPREAD]].any():
            return press
        by_poisson, by_spread = self._linear(inclusions, reference=reference)
        return np.asarray(press + nuisance[POISSON] * by_poisson + nuisance[SPREAD] * by_spread)

    def _finite(self, inclusions: Floats | None, nuisance: Floats) -> Floats:
        """What finite strain adds to the rings' responses, (frames, n or 1, 3 rings)."""
        return np.asarray(self._finite_moved(inclusions, nuisance, (None,))[0])

    def _finite_moved(self, inclusions: Floats | None, nuisance: Floats, names: tuple[int | None, ...]) -> Floats:
        """See `_finite`; with each of ``names`` moved by `STEP`, None for none, `SHARED` for all log forces.

        The shape is (names, frames, n or 1, 3 rings). A probe and tissue stiffer by a factor under a force larger by it
        have pressures larger by it.
        """
        frames = len(self.force_n)
        if self.correction is None:
            return np.zeros((len(names), frames, 1, 1))
        moved = nuisance[: SHARED + 1] + STEP * np.array([np.arange(SHARED + 1) == name for name in names])
        stiffer = np.exp(moved[:, PROBE, None])
        pushes = np.array([push for push, _ in self._pushes(nuisance)])
        forces = pushes * np.exp(moved[:, SHARED, None] - nuisance[SHARED])
        tissue = self.prior.tissue_young_kpa * np.exp(moved[:, TISSUE, None] + self.is_reference * moved[:, SITE, None])
        thickness = self.prior.thickness_mm * np.exp(moved[:, THICKNESS, None]) * np.ones_like(tissue)
        states = np.stack([tissue / stiffer, thickness, forces / stiffer], axis=-1)
        added = self.correction.without_inclusion(states.reshape(-1, 3)).reshape(len(names), frames, 1, -1)
        targets = np.flatnonzero(~self.is_reference)
        if inclusions is not None and len(targets):
            added = np.repeat(added, len(inclusions), axis=2)
            for young in np.unique(tissue[:, targets[0]]).tolist():  # one but for a step of the tissue's modulus
                alike = np.flatnonzero(tissue[:, targets[0]] == young)
                added[np.ix_(alike, targets)] += self._finite_signals(
                    inclusions, young, states[np.ix_(alike, targets)], stiffer[alike, 0]
                )
        added[..., : self.rings.count] *= stiffer[:, :, None, None]
        return np.asarray(added)

    def _finite_signals(self, inclusions: Floats, tissue_kpa: float, states: Floats, stiffer: Floats) -> Floats:
        """What finite strain adds to the signals of inclusions, for ``states`` (k, targets, 3) of one tissue."""
        if self.correction is None:
            raise AssertionError("only called at finite strain")
        signals = []
        for factor, slabs in zip(stiffer.tolist(), states.tolist(), strict=True):
            young, thick, _ = slabs[0]
            softer = inclusions / np.array([1.0, 1.0, factor])
            signal = self.rings.on(young, thick, softer) - self.rings.on(young, thick, None)
            signals += [self.rings.under(force, signal) for _, _, force in slabs]
        change = self.correction.change(
            inclusions[:, 0],
            inclusions[:, 1],
            inclusions[:, 2] / tissue_kpa,
            states.reshape(-1, 3),
            np.array(signals),
        )
        return change.reshape(*states.shape[:2], *change.shape[1:])

    def _finite_changes(self, inclusions: Floats | None, nuisance: Floats) -> tuple[Floats, dict[int, Floats]]:
        """`_finite` and its derivatives by the nuisances of the press, that by a frame's log force under `SHARED`."""
        nothing = np.zeros((len(self.force_n), 1, 1))
        names = (TISSUE, THICKNESS, PROBE, SHARED)
        if self.correction is None:
            return nothing, dict.fromkeys((*names, SITE, POISSON, SPREAD), nothing)
        finite, *moved = self._finite_moved(inclusions, nuisance, (None, *names))
        by = {name: (there - finite) / STEP for name, there in zip(names, moved, strict=True)}
        site = np.where(self.is_reference[:, None, None], by[TISSUE], 0.0)
        return finite, by | {SITE: site, POISSON: nothing, SPREAD: nothing}

    def _changes(
        self, inclusions: Floats | None, nuisance: Floats, press: Floats, *, reference: bool
    ) -> dict[int, Floats]:
        """Derivatives of the ring responses with respect to the nuisances of the press."""
        shown = None if reference else inclusions
        by_poisson, by_spread = self._linear(inclusions, reference=reference)
        press = press - nuisance[POISSON] * by_poisson - nuisance[SPREAD] * by_spread
        here = (
            float(nuisance[TISSUE] + reference * nuisance[SITE]),
            float(nuisance[THICKNESS]),
            float(nuisance[PROBE]),
        )

        def by(tissue: float, thickness: float, probe: float) -> Floats:
            there = self._at(here[0] + tissue, here[1] + thickness, here[2] + probe, shown)
            return np.asarray((there - press) / STEP)

        by_tissue = by(STEP, 0.0, 0.0)
        return {
            TISSUE: by_tissue,
            THICKNESS: by(0.0, STEP, 0.0),
            SITE: by_tissue if reference else np.zeros_like(by_tissue),
            PROBE: by(0.0, 0.0, STEP),
            POISSON: by_poisson,
            SPREAD: by_spread,
        }

    def _at(self, log_tissue: float, log_thickness: float, log_probe: float, inclusions: Floats | None) -> Floats:
        """Ring responses; a probe stiffer by a factor is equivalent to tissue softer by it."""
        stiffer = float(np.exp(log_probe))
        tissue = self.prior.tissue_young_kpa * float(np.exp(log_tissue)) / stiffer
        thickness = self.prior.thickness_mm * float(np.exp(log_thickness))
        shown = None if inclusions is None else inclusions / np.array([1.0, 1.0, stiffer])
        return self.rings.stiffened(stiffer, self.rings.on(tissue, thickness, shown))

    def _linear(self, inclusions: Floats | None, *, reference: bool) -> tuple[Floats, Floats]:
        """Derivatives with respect to Poisson's ratio and the spread, assumed constant."""
        return self.rings.linear(
            self.prior.tissue_young_kpa, self.prior.thickness_mm, None if reference else inclusions
        )

    def _light(self, press: Floats, nuisance: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Grey levels of presses (n, 3 rings) at nominal gain, and derivatives by response, emphasis and errors."""
        pressure, displacement, slope = _parts(press)
        bent, by_square = self._bent(pressure, nuisance), self.shading.uncertainty.by_square
        contact = rough_contact(pressure, self.calibration) * bent
        shade = self.shading(displacement, slope, nuisance[SHADE], self._errors(nuisance))
        steeper = -2 * float(by_square @ self._errors(nuisance)) * pressure * contact
        by_pressure = (rough_contact_slope(pressure, self.calibration) * bent + steeper) * shade.factor
        by_answer = np.concatenate([by_pressure, contact * shade.by_displacement, contact * shade.by_slope], axis=-1)
        light = contact * shade.factor
        by_errors = contact[..., None] * shade.by_errors - (light * pressure**2)[..., None] * by_square
        return light, by_answer, contact[..., None] * shade.by_emphasis, by_errors

    def _bent(self, pressure: Floats, nuisance: Floats) -> Floats:
        """Factor on the light of the contact by the errors of the contact law."""
        bend = float(self.shading.uncertainty.by_square @ self._errors(nuisance))
        return np.asarray(np.exp(-bend * pressure**2))


def _parts(responses: Floats) -> Floats:
    """Pressures, displacements and slopes (3, ..., rings) of responses (..., 3 rings), without a copy."""
    return np.moveaxis(responses.reshape(*responses.shape[:-1], OUTPUTS_PER_RING, -1), -2, 0)


def _along(by_answer: Floats, direction: Floats) -> Floats:
    """Derivative of the rings' light along a change of the press: the sum over the three responses."""
    return np.asarray(_parts(by_answer * direction).sum(axis=0))
