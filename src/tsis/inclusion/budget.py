"""What an estimate depends on: its uncertainty budget in the terms of the GUM, and its shift under other priors.

With the rings linear in the inclusion by J, R the sum of the covariances R_k of all sources, P the covariance of the
prior, C = (J' R^-1 J + P^-1)^-1 and G = C J' R^-1, the covariance C of the estimate is the sum of the contributions
G R_k G' and C P^-1 C.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.errors import InputError, NotIdentifiedError, UntrustedError
from tsis.inclusion.estimation import analyse, estimate
from tsis.inclusion.flags import NAMES
from tsis.inclusion.posterior.forward import SHARED, SHARED_NUISANCES
from tsis.inclusion.prior import PARAMETERS
from tsis.model.budget import QuantityBudget, UncertaintyComponent
from tsis.model.content import ContentValue
from tsis.model.estimate import Estimate, label_of, unit_of
from tsis.model.require import require_one_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from tsis.inclusion.estimation import InclusionAnalysis
    from tsis.inclusion.posterior.likelihood import ErrorSources
    from tsis.inclusion.prior import Floats, InclusionPrior
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


# For each nuisance: the source, and the unit of its standard uncertainty
OF_NUISANCE = MappingProxyType(
    {
        "gain": ("gain of the light", "1"),
        "tissue": ("modulus of the tissue", "1"),
        "thickness": ("thickness of the tissue", "1"),
        "site": ("tissue of the reference site", "1"),
        "probe": ("moduli of the probe", "1"),
        "poisson": ("Poisson's ratio", "1"),
        "spread": ("squared distance from the axis", "mm2"),
        "shade": ("shading of the dented face", "1"),
        "force": ("force of each frame", "1"),
        "offset": ("offset of each frame", "grey"),
        "light": ("light that was not measured on dents", "1"),
    }
)
OF_COVARIANCE = MappingProxyType(
    {
        "pattern": ("fixed pattern", "B"),
        "repeatability": ("repeatability of the press", "A"),
        "pixels": ("noise of the pixels", "A"),
        "model": ("error of the surrogate", "B"),
        "heterogeneity": ("heterogeneity of the tissue", "B"),
        "position": ("model of an inclusion off the axis", "B"),
    }
)
IN_GREY = ("pixels", "position")  # of the covariances; the others are relative
OF_PRIOR = MappingProxyType({name: f"prior of the {NAMES[name]}" for name in PARAMETERS})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UncertaintyBudget(ContentValue):
    """Uncertainty budgets of an estimate's parameters.

    Attributes
    ----------
    estimate
        The estimate.
    quantities
        Budget of each parameter that the data identify, by name; empty for an estimate that is not trusted.

    ``budget["depth_mm"]`` is the budget of a parameter. It raises `UntrustedError` or `NotIdentifiedError` where it is
    withheld, and `UnknownNameError` for a name that is no parameter.
    """

    estimate: Estimate
    quantities: Mapping[str, QuantityBudget]

    @property
    def withheld(self) -> dict[str, str]:
        """Why there is no budget of a parameter, by name."""
        return {
            name: self.estimate.withheld_reason(name) for name in self.estimate.names if name not in self.quantities
        }

    def __getitem__(self, name: str) -> QuantityBudget:
        require_one_of("parameter", name, self.estimate.names)
        if name in self.quantities:
            return self.quantities[name]
        if not self.estimate.trusted:
            flags = ", ".join(self.estimate.flags)
            raise UntrustedError(f"{name} must have a trusted estimate for a budget; this one is not trusted ({flags})")
        raise NotIdentifiedError(f"{name} must be identified by the data for a budget; it is not: take its interval")


def uncertainty_budget(
    images: TactileImage | Sequence[TactileImage],
    *,
    probe: Probe,
    calibration: Calibration,
    reference: TactileImage | Sequence[TactileImage] | None = None,
    prior: InclusionPrior | None = None,
    progress: Callable[[int, int], None] | None = None,
    strain: str | None = None,
) -> UncertaintyBudget:
    """Estimate an inclusion, and list what its uncertainty consists of.

    The model is linearised at the posterior's mean, and the uniform prior counts as a normal one of the same variance.
    `QuantityBudget.departure` compares the combined uncertainty with the standard deviation of the samples, which
    assume neither. Parameters and errors as `estimate`.

    Returns
    -------
    UncertaintyBudget
        With the estimate. Parameters whose numbers are withheld have no budget.
    """
    analysis = analyse(
        images,
        probe=probe,
        calibration=calibration,
        reference=reference,
        prior=prior,
        progress=progress,
        strain=strain,
    )
    estimate = analysis.estimate
    shown = [name for name in PARAMETERS if not estimate.withheld_reason(name)]
    if not shown:
        return UncertaintyBudget(estimate=estimate, quantities={})
    with one_blas_thread():  # threads slow down matrices this small
        parts = _components(analysis)
    return UncertaintyBudget(
        estimate=estimate,
        quantities={
            name: QuantityBudget(
                name=name,
                value=estimate.mean[name],
                unit=unit_of(name),
                components=tuple(part.component(PARAMETERS.index(name)) for part in parts),
                sampled_sd=estimate.sd[name],
            )
            for name in shown
        },
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Part:
    """A source, and the standard deviations (3,) that it alone gives the parameters."""

    source: str
    evaluation: str
    distribution: str
    sd: float  # of the source
    unit: str
    contribution: Floats

    def component(self, index: int) -> UncertaintyComponent:
        return UncertaintyComponent(
            source=self.source,
            evaluation=self.evaluation,
            distribution=self.distribution,
            standard_uncertainty=self.sd,
            unit=self.unit,
            contribution=float(self.contribution[index]),
        )


def _components(analysis: InclusionAnalysis) -> list[_Part]:
    likelihood, fit = analysis.likelihood, analysis.posterior.fit
    sources = likelihood.sources(
        analysis.posterior.middle, likelihood.within(fit.nuisance[0]), model_error=analysis.model_error
    )
    prior_sd = np.array([analysis.prior.sd[name] for name in PARAMETERS])
    spread = propagate(sources, prior_sd)
    calibration = likelihood.model.calibration
    sd_of = {
        "pattern": calibration.pattern_sd,
        "repeatability": calibration.repeatability_sd,
        "model": analysis.model_error,
        "heterogeneity": sources.tissue_sd,
    } | {
        name: float(np.sqrt(np.diag(sources.covariance[name]).mean())) for name in IN_GREY if name in sources.covariance
    }
    parts = [
        _Part(
            source=source,
            evaluation="B",
            distribution="normal",
            sd=float(np.sqrt(np.mean(sources.nuisance_sd[nuisance_columns(name, sources)] ** 2))),
            unit=unit,
            contribution=np.sqrt(np.diag(spread[name])),
        )
        for name, (source, unit) in OF_NUISANCE.items()
        if name in spread
    ]
    parts += [
        _Part(
            source=source,
            evaluation=evaluation,
            distribution="normal",
            sd=sd_of[name],
            unit="grey" if name in IN_GREY else "1",
            contribution=np.sqrt(np.maximum(np.diag(spread[name]), 0.0)),
        )
        for name, (source, evaluation) in OF_COVARIANCE.items()
        if name in spread
    ]
    parts += [
        _Part(
            source=source,
            evaluation="B",
            distribution="rectangular",
            sd=analysis.prior.sd[name],
            unit=unit_of(name),
            contribution=np.sqrt(np.diag(spread[source])),
        )
        for name, source in OF_PRIOR.items()
    ]
    return [part for part in parts if part.sd > 0]  # a source that is known exactly is none


def nuisance_columns(name: str, sources: ErrorSources) -> list[int]:
    """Columns of a nuisance; forces and offsets have one a frame."""
    first, frames = SHARED, sources.frames
    columns = {
        "force": range(first, first + frames),
        "offset": range(first + frames, first + 2 * frames),
        "light": range(first + 2 * frames, len(sources.nuisance_sd)),
    }
    return list(columns.get(name, [place for place, shared in enumerate(SHARED_NUISANCES) if shared == name]))


def propagate(sources: ErrorSources, prior_sd: Floats) -> dict[str, Floats]:
    """Covariance (3, 3) of the parameters by each source, the prior of each parameter included; their sum is C.

    ``prior_sd`` are the standard deviations (3,) of the prior.
    """
    change = sources.by_inclusion
    total = sources.by_nuisance @ sources.by_nuisance.T + sum(sources.covariance.values())
    root = scipy.linalg.cho_factor(total, lower=True)
    weighted = scipy.linalg.cho_solve(root, change)  # R^-1 J
    precision = np.diag(prior_sd**-2.0)
    scale = np.outer(prior_sd, prior_sd)  # of one order of magnitude, to invert
    covariance = np.linalg.inv((change.T @ weighted + precision) * scale) * scale
    gain = covariance @ weighted.T
    moved = gain @ sources.by_nuisance
    spread = {
        name: moved[:, columns] @ moved[:, columns].T
        for name in OF_NUISANCE
        if (columns := nuisance_columns(name, sources))
    }
    spread |= {name: gain @ part @ gain.T for name, part in sources.covariance.items()}
    # C P^-1 C, a part for the prior of each parameter
    return spread | {
        source: np.outer(column, column) / sd**2
        for source, column, sd in zip(OF_PRIOR.values(), covariance, prior_sd, strict=True)
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorShift:
    """The same presses under another prior.

    Attributes
    ----------
    name
        Of the other prior.
    shift_sd
        Difference of the means, other prior minus own, over the own standard deviation, by parameter; without the
        parameters that one of the two does not identify, and empty where one of the two is not trusted.
    reason
        Why there is no shift; empty where there is one.
    """

    name: str
    shift_sd: Mapping[str, float]
    reason: str = ""

    def __str__(self) -> str:
        if not self.shift_sd:
            return f"{self.name}: {self.reason}"
        moved = ", ".join(f"{label_of(name)} {shift:+.1f} sd" for name, shift in self.shift_sd.items())
        return f"{self.name}: {moved}"


def prior_sensitivity(
    own: Estimate, images: Sequence[TactileImage], priors: Mapping[str, InclusionPrior], **call: Any
) -> tuple[PriorShift, ...]:
    """Estimate the presses again under each of the ``priors``, by name.

    ``call`` are the other arguments of `estimate`; the tables of another prior are built once. A press that another
    prior does not allow is stated in the shift's ``reason``.
    """
    shifts = []
    for name, prior in priors.items():
        try:
            other = estimate(images, **{**call, "prior": prior})
        except InputError as error:
            shifts.append(PriorShift(name=name, shift_sd={}, reason=f"no estimate ({error})"))
            continue
        if not (own.trusted and other.trusted):
            shifts.append(PriorShift(name=name, shift_sd={}, reason="not trusted" if own.trusted else "not compared"))
            continue
        known = [one for one in PARAMETERS if own.identified(one) and other.identified(one)]
        moved = {one: (other.mean[one] - own.mean[one]) / own.sd[one] for one in known}
        shifts.append(PriorShift(name=name, shift_sd=moved, reason="" if moved else "nothing identified"))
    return tuple(shifts)


def with_prior_sensitivity(own: Estimate, shifts: Sequence[PriorShift]) -> Estimate:
    """The estimate with a sentence on its shifts in its notes, which every result prints.

    The notes of an untrusted estimate belong to its flags one by one, and are withheld with them; so the sentence,
    which holds no number then, ends the last note that is printed.
    """
    sentence = f"Under other priors: {'; '.join(map(str, shifts))}."
    if own.trusted:
        return replace(own, notes=(*own.notes, sentence))
    if not own.printed_notes:
        return own
    place = len(own.notes) - 1 - own.notes[::-1].index(own.printed_notes[-1])
    return replace(own, notes=(*own.notes[:place], f"{own.notes[place]} {sentence}", *own.notes[place + 1 :]))
