"""What an estimate of an inclusion gets wrong where one of its assumptions fails, and whether it says so.

    python -m benchmarks.assumptions --cases 6 --seed 61

Presses of the domed protocol (the flat one off the axis) on a sphere of 9 mm, 6 mm deep, 80 kPa in 5 kPa, made by
`benchmarks.worlds` (finer mesh, other order, traced lamps, all nuisances of the virtual probe drawn anew in each case).
Printed are the mean error in posterior standard deviations, its scatter between cases, and how many estimates were
untrusted.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench
from benchmarks.judgement import compared
from benchmarks.simulated_presses import DEFAULT, PROTOCOLS
from benchmarks.worlds import UnevenProbe

import tsis
from tsis.errors import TsisError
from tsis.inclusion import InclusionPrior, estimate
from tsis.model.phantom import Inclusion, Phantom

if TYPE_CHECKING:
    from collections.abc import Callable

    Sites = tuple[Phantom, Phantom]  # target and reference site

INCLUSION = Inclusion(diameter_mm=9.0, depth_mm=6.0, young_kpa=80.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """One assumption that fails: what it does to the phantoms."""

    name: str
    sites: Callable[[Phantom, Phantom], Sites] = lambda target, site: (target, site)
    protocol: str = DEFAULT


def _inclusion(**changes: Any) -> Callable[[Phantom, Phantom], Sites]:
    def change(target: Phantom, site: Phantom) -> Sites:
        assert target.inclusion is not None
        return replace(target, inclusion=replace(target.inclusion, **changes)), site

    return change


def _poisson(value: float) -> Callable[[Phantom, Phantom], Sites]:
    def change(target: Phantom, site: Phantom) -> Sites:
        assert target.inclusion is not None
        inside = replace(target.inclusion, poisson=value)
        return replace(target, poisson=value, inclusion=inside), replace(site, poisson=value)

    return change


def _softer_site(factor: float) -> Callable[[Phantom, Phantom], Sites]:
    return lambda target, site: (target, replace(site, young_kpa=factor * site.young_kpa))


def _spheroid(aspect: float) -> Callable[[Phantom, Phantom], Sites]:
    """A spheroid of the sphere's volume and top; ``aspect`` is its height over its width."""
    wide = INCLUSION.diameter_mm / 2 * aspect ** (-1 / 3)
    return _inclusion(semi_axes_mm=(wide, wide, wide * aspect))


FAILURES = (
    Failure(name="none"),
    Failure(name="Poisson's ratio 0.45", sites=_poisson(0.45)),
    Failure(name="Poisson's ratio 0.495", sites=_poisson(0.4949)),
    Failure(name="spheroid, 0.7 as high as wide", sites=_spheroid(0.7)),
    Failure(name="spheroid, 1.4 as high as wide", sites=_spheroid(1.4)),
    Failure(name="reference site softer by 10 %, or held longer", sites=_softer_site(0.9)),
    Failure(name="reference site stiffer by 10 %", sites=_softer_site(1.1)),
    # In three dimensions only flat probes press
    Failure(name="none, flat probe", protocol="flat"),
    Failure(name="2 mm off the axis, flat probe", sites=_inclusion(offset_mm=(2.0, 0.0)), protocol="flat"),
    Failure(name="4 mm off the axis, flat probe", sites=_inclusion(offset_mm=(4.0, 0.0)), protocol="flat"),
)


def judged(failure: Failure, *, seed: int, index: int) -> dict[str, Any]:
    """One case of a failure; the same index has the same nuisances in every failure."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    protocol, prior = PROTOCOLS[failure.protocol], InclusionPrior()
    virtual = UnevenProbe(protocol.probe, rng=rng, strain="small")
    inclusion = replace(INCLUSION, poisson=prior.poisson)
    target = Phantom(young_kpa=5.0, poisson=prior.poisson, thickness_mm=30.0, inclusion=inclusion)
    site_error = float(np.exp(virtual.calibration.site_sd * rng.standard_normal()))
    site = replace(target.without_inclusion(), young_kpa=target.young_kpa * site_error)
    presses = [
        [virtual.press(phantom, force_n=force) for force in protocol.forces_n]
        for phantom in failure.sites(target, site)
    ]
    try:
        result = estimate(
            presses[0], probe=protocol.probe, calibration=virtual.calibration, reference=presses[1], prior=prior
        )
    except TsisError as error:
        return {"failure": failure.name, "index": index, "refused": str(error)}
    return {"failure": failure.name, "index": index, **compared(result, INCLUSION)}


def rows_of(found: list[dict[str, Any]]) -> list[list[str]]:
    """Rows of the table: errors in standard deviations, untrusted cases, the commonest flags."""
    rows = []
    for failure in dict.fromkeys(one["failure"] for one in found):
        cases = [one for one in found if one["failure"] == failure and "mean" in one]
        refused = sum(one["failure"] == failure and "refused" in one for one in found)
        if not cases:
            rows.append([failure, "", "", "", f"{refused} refused", ""])
            continue
        mean, truth, sd = (np.array([one[name] for one in cases]) for name in ("mean", "truth", "sd"))
        errors = (mean - truth) / sd
        untrusted = sum(not one["trusted"] for one in cases)
        flags = [flag for one in cases for flag in one["flags"] if not flag.endswith("not_identified")]
        common = sorted(set(flags), key=flags.count, reverse=True)[:2]
        rows.append(
            [
                failure,
                *(f"{part.mean():+.1f} ± {part.std():.1f}" for part in errors.T),
                f"{untrusted} of {len(cases)}",
                ", ".join(common),
            ]
        )
    return rows


def main() -> int:
    bench = Bench(__doc__, cases=6, seed=61, only=str)
    chosen = [failure for failure in FAILURES if bench.only is None or bench.only in failure.name]
    found = [judged(failure, seed=bench.seed, index=index) for failure in chosen for index in range(bench.cases)]
    heads = ("fails", "diameter", "depth", "modulus", "untrusted", "flags")
    bench.table(f"{bench.cases} cases each, seed {bench.seed}, tsis {tsis.__version__}", heads, rows_of(found))
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
