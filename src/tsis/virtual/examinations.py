"""Repeated virtual examinations with everything drawn anew: how often do the intervals hold the truth?"""

from __future__ import annotations

import json
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from importlib.resources import files
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import TsisError
from tsis.inclusion import estimate
from tsis.inclusion.prior import PARAMETERS
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.require import require_integer, require_one_of
from tsis.virtual.probe import RESOLUTIONS, VirtualProbe, exposure_for

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from tsis.inclusion import InclusionPrior
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe

LARGEST_DRAWN_POISSON = 0.4949
DEEPEST_FRACTION = 0.97  # of the slab that an inclusion may reach down to: what is thinner is not meshed well
LEVELS = (0.5, 0.9)
STORED = "demo_coverage.json"


def draw_phantom(prior: InclusionPrior, rng: np.random.Generator) -> Phantom:
    """An inclusion, uniform over the prior's ranges, in tissue of the prior; the thickness is redrawn until it fits.

    Redrawing all of it would make large deep inclusions rarer than the prior has them.
    """
    diameter, depth, young = (float(value) for value in rng.uniform(prior.low, prior.high))
    return surround(Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young), prior, rng)


def surround(inclusion: Inclusion, prior: InclusionPrior, rng: np.random.Generator) -> Phantom:
    """A given inclusion in tissue drawn from the prior: log-normal modulus and thickness, one Poisson's ratio."""
    young = prior.tissue_young_kpa * float(np.exp(prior.tissue_young_sd * rng.standard_normal()))
    poisson = min(prior.poisson + prior.poisson_sd * float(rng.standard_normal()), LARGEST_DRAWN_POISSON)
    while True:
        thickness = prior.thickness_mm * float(np.exp(prior.thickness_sd * rng.standard_normal()))
        if inclusion.bottom_mm < DEEPEST_FRACTION * thickness:
            break
    return Phantom(
        young_kpa=young, thickness_mm=thickness, poisson=poisson, inclusion=replace(inclusion, poisson=poisson)
    )


def reference_site(virtual: VirtualProbe, phantom: Phantom, rng: np.random.Generator) -> Phantom:
    """Tissue nearby without inclusion, whose modulus differs as the calibration says that sites differ."""
    error = virtual.calibration.site_sd * float(rng.standard_normal())
    return replace(phantom.without_inclusion(), young_kpa=phantom.young_kpa * float(np.exp(error)))


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedExamination:
    """An examination by one protocol, repeated with another seed each time.

    Each seed draws the inclusion, the tissue's modulus, thickness and Poisson's ratio from the prior, and all that a
    virtual probe draws: gain, stiffness, pattern and shading, the modulus of the reference site, and of each press the
    force, stray light, pattern and noise. The tissue is even and the inclusion a sphere on the axis.

    Attributes
    ----------
    probe, prior
        What presses, and what is drawn from and believed.
    forces_n
        Forces of the presses on the target and on the reference site.
    strain
        Mechanics of the presses and of the estimate: ``"finite"`` or ``"small"``.
    """

    probe: Probe
    prior: InclusionPrior
    forces_n: tuple[float, ...] = (0.5, 1.0)
    strain: str = "finite"

    def __post_init__(self) -> None:
        require_one_of("strain", self.strain, RESOLUTIONS)

    def once(self, seed: int) -> dict[str, Any]:
        """One examination: whether each interval holds the truth, or why the press or the estimate was refused."""
        rng = np.random.default_rng(require_integer("seed", seed, 0, 2**63 - 1))
        phantom = draw_phantom(self.prior, rng)
        virtual = VirtualProbe(self.probe, rng=rng, strain=self.strain, exposure=exposure_for(max(self.forces_n)))
        site = reference_site(virtual, phantom, rng)
        try:
            images, references = self._pressed(virtual, phantom), self._pressed(virtual, site)
            result = estimate(
                images, probe=self.probe, calibration=virtual.calibration, reference=references, prior=self.prior
            )
        except TsisError as error:
            return {"seed": seed, "refused": f"{type(error).__name__}: {error}"}
        truth = {name: float(getattr(phantom.inclusion, name)) for name in PARAMETERS}
        inside = {f"{level:g}": _inside(result.untrusted.interval(level), truth) for level in LEVELS}
        return {"seed": seed, "truth": truth, "held": inside, "trusted": result.trusted}

    def _pressed(self, virtual: VirtualProbe, phantom: Phantom) -> list[TactileImage]:
        return [virtual.press(phantom, force_n=force) for force in self.forces_n]

    def run(
        self,
        count: int,
        *,
        first_seed: int = 0,
        workers: int | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> list[dict[str, Any]]:
        """Answers of `once` for ``count`` seeds from ``first_seed`` on, in order; solved by all cores."""
        seeds = range(first_seed, first_seed + require_integer("count", count, 1, 100_000))
        results = {seeds[0]: self.once(seeds[0])}  # fills the caches of light and tables before the workers share them
        if progress is not None:
            progress(1, count)
        with ProcessPoolExecutor(workers or os.cpu_count(), get_context("spawn")) as pool:
            for future in as_completed([pool.submit(self.once, seed) for seed in seeds[1:]]):
                results[future.result()["seed"]] = future.result()
                if progress is not None:
                    progress(len(results), count)
        return [results[seed] for seed in seeds]


def _inside(intervals: Mapping[str, tuple[float, float]], truth: Mapping[str, float]) -> dict[str, bool]:
    return {name: bool(low <= truth[name] <= high) for name, (low, high) in intervals.items()}


def coverage_counts(cases: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Counts over the answers of `RepeatedExamination.once`: cases, trusted and refused ones, intervals that held.

    Untrusted estimates count like the others; ``held_trusted`` counts the trusted ones alone.
    """
    answered = [case for case in cases if "refused" not in case]
    trusted = [case for case in answered if case["trusted"]]

    def inside(among: list[Mapping[str, Any]]) -> dict[str, dict[str, int]]:
        return {
            f"{level:g}": {name: sum(case["held"][f"{level:g}"][name] for case in among) for name in PARAMETERS}
            for level in LEVELS
        }

    reasons = Counter(case["refused"].partition(":")[0] for case in cases if "refused" in case)
    return {
        "cases": len(cases),
        "answered": len(answered),
        "trusted": len(trusted),
        "refused": dict(sorted(reasons.items())),
        "held": inside(answered),
        "held_trusted": inside(trusted),
    }


def stored_coverage() -> dict[str, Any]:
    """The result of ``tsis demo --seeds 100`` that ships with the package, with its command and version."""
    counts: dict[str, Any] = json.loads((files("tsis") / "catalog" / STORED).read_text(encoding="utf-8"))
    return counts
