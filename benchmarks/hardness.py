"""How well is the modulus of a touched sphere estimated, and do its intervals hold?

    python -m benchmarks.hardness --probe tsis-direct --spheres 40 --rigs 5 --seed 1
    python -m benchmarks.hardness --probe tsis-2011 --spheres 40 --rigs 5 --seed 1 --ball

Spheres of 40 to 500 kPa, even in the logarithm, of 3.0 to 3.6 mm radius and a Poisson's ratio of 0.45 to 0.495 are
pressed at 0.7 and 1.2 N by rigs of the finer model with all their errors: gain, drift, missed forces, probe moduli,
patterns, stray light, noise, a radius written down wrongly, a place beside the axis. Each sphere is pressed by
``--rigs`` rigs; a rig whose probe is stiffer takes a stiffer sphere. With ``--ball`` estimates are made with two
presses of a rigid ball of 3 mm as well, which a soft probe needs; on a stiff one its picture clips. The source's two
materials follow, 12 rigs each, its printed errors beside. Solved presses are kept in the cache: a run that was cut off
goes on where it stopped.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.hardness_bank import SolvedSphere
from benchmarks.harness import Bench
from scipy.stats import norm

import tsis
from tsis.catalog.phantoms import load_sphere
from tsis.cli.progress import progress_bar
from tsis.errors import TsisError
from tsis.hardness import estimate
from tsis.model.phantom import SoftSphere
from tsis.virtual.direct_contact import DirectContactRig

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe

FORCES_N = (0.7, 1.2)
YOUNG_KPA, RADIUS_MM, POISSON = (40.0, 500.0), (3.0, 3.6), (0.45, 0.495)
BANDS_KPA = (40.0, 75.0, 150.0, 275.0, 500.0)
PRINTED = {"cl2000x": 0.0423, "cl2003x": 0.0538}  # relative errors of section 5.4
REPEATS = 12
NEIGHBOURS = (0.94, 1.0, 1.07)  # moduli around a material's at which its presses are solved
BALL = SoftSphere(radius_mm=3.0, young_kpa=3e5, poisson=0.3, name="rigid ball")
BALL_SD_MM = 0.003


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One sphere under one rig: truth, and what was estimated without and with the rigid ball."""

    young_kpa: float
    alone: dict[str, Any]
    with_ball: dict[str, Any] | None


def case_of(
    probe: Probe, bank: SolvedSphere, ball: SolvedSphere | None, seed: Sequence[int], young_kpa: float | None
) -> Case:
    """Press a solved sphere with a new rig; its modulus is ``young_kpa``, or the solved one times the stiffness."""
    rng = np.random.default_rng(seed)
    rig = DirectContactRig(probe, rng=rng, solve=bank)
    true = bank.young_kpa[0] * rig.stiffness if young_kpa is None else young_kpa
    sphere = SoftSphere(radius_mm=bank.radius_mm, young_kpa=true, poisson=bank.poisson)
    images = rig.press_path(sphere, forces_n=FORCES_N)

    def judged(reference: Sequence[TactileImage] | None) -> dict[str, Any]:
        started = time.perf_counter()
        try:
            found = estimate(images, probe=probe, calibration=rig.calibration, reference=reference)
        except TsisError as error:
            return {"refused": str(error)}
        posterior = found.untrusted
        return {
            "mean": posterior.mean["young_kpa"],
            "half": posterior.interval(0.5)["young_kpa"],
            "most": posterior.interval(0.9)["young_kpa"],
            "trusted": found.trusted,
            "flags": found.flags,
            "seconds": time.perf_counter() - started,
        }

    if ball is None:
        return Case(young_kpa=true, alone=judged(None), with_ball=None)
    balls = rig.solved_by(ball, radius_sd_mm=BALL_SD_MM).press_path(BALL, forces_n=FORCES_N)
    return Case(young_kpa=true, alone=judged(None), with_ball=judged(balls))


def spheres(probe: Probe, count: int, seed: int) -> list[SolvedSphere]:
    """The drawn spheres; the first ones are the same whatever the count."""
    drawn = []
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        young = float(np.exp(rng.uniform(*np.log(YOUNG_KPA))))
        drawn.append(
            SolvedSphere(
                probe=probe,
                radius_mm=float(rng.uniform(*RADIUS_MM)),
                poisson=float(rng.uniform(*POISSON)),
                young_kpa=(young,),
                forces_n=FORCES_N,
            )
        )
    return drawn


def wilson(inside: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Confidence interval of a share."""
    z = float(norm.ppf(0.5 + level / 2))
    middle = (inside + z**2 / 2) / (count + z**2)
    half = z / (count + z**2) * np.sqrt(inside * (count - inside) / count + z**2 / 4)
    return float(middle - half), float(middle + half)


def summary(truths: Sequence[float], answers: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Errors and coverage of the trusted answers."""
    used = [(truth, one) for truth, one in zip(truths, answers, strict=True) if one.get("trusted")]
    flags = [flag for one in answers for flag in one.get("flags", ())]
    result = {
        "cases": len(answers),
        "trusted": len(used),
        "refused": sum("refused" in one for one in answers),
        "flags": {flag: flags.count(flag) for flag in sorted(set(flags))},
    }
    if not used:
        return result
    error = np.array([one["mean"] / truth - 1 for truth, one in used])
    result |= {"mean_relative_error": float(np.abs(error).mean()), "bias": float(error.mean())}
    result["median_relative_error"] = float(np.median(np.abs(error)))
    for name, level in (("half", "50"), ("most", "90")):
        inside = sum(one[name][0] <= truth <= one[name][1] for truth, one in used)
        result[f"coverage_{level}"] = inside / len(used)
        result[f"coverage_{level}_wilson"] = wilson(inside, len(used))
    return result


def ball_on(probe: Probe) -> SolvedSphere:
    return SolvedSphere(
        probe=probe, radius_mm=BALL.radius_mm, poisson=BALL.poisson, young_kpa=(BALL.young_kpa,), forces_n=FORCES_N
    )


def run(
    probe: Probe,
    count: int,
    rigs: int,
    seed: int,
    ball: SolvedSphere | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """All cases of one probe, judged."""
    cases, unsolved = list[Case](), 0
    for index, bank in enumerate(spheres(probe, count, seed)):
        if progress is not None:
            progress(index, count + len(PRINTED))
        try:
            cases += [case_of(probe, bank, ball, [seed, index, rig], None) for rig in range(rigs)]
        except TsisError as error:
            print(f"sphere {index} of {bank.young_kpa[0]:.1f} kPa: {error}", file=sys.stderr)
            unsolved += 1
    result: dict[str, Any] = {"probe": probe.name, "unsolved": unsolved, "seed": seed}
    result["all"] = _both(cases)
    for low, high in pairwise(BANDS_KPA):
        result[f"{low:g} to {high:g} kPa"] = _both([case for case in cases if low <= case.young_kpa < high])
    for place, name in enumerate(PRINTED):
        if progress is not None:
            progress(count + place, count + len(PRINTED))
        try:
            result[name] = _both(material(probe, ball, name, seed)) | {"printed_relative_error": PRINTED[name]}
        except TsisError as error:
            print(f"{name}: {error}", file=sys.stderr)
    seconds = [case.alone["seconds"] for case in cases if "seconds" in case.alone]
    result["seconds_an_estimate"] = float(np.median(seconds)) if seconds else None
    return result


def material(probe: Probe, ball: SolvedSphere | None, name: str, seed: int) -> list[Case]:
    """Rigs that press one of the source's materials."""
    sphere = load_sphere(name)
    young = tuple(factor * sphere.young_kpa for factor in NEIGHBOURS)
    bank = SolvedSphere(
        probe=probe, radius_mm=sphere.radius_mm, poisson=sphere.poisson, young_kpa=young, forces_n=FORCES_N
    )
    return [
        case_of(probe, bank, ball, [seed, place, len(name), round(sphere.young_kpa)], sphere.young_kpa)
        for place in range(REPEATS)
    ]


def _both(cases: Sequence[Case]) -> dict[str, Any]:
    truths = [case.young_kpa for case in cases]
    result = {"alone": summary(truths, [case.alone for case in cases])}
    with_ball = [case.with_ball for case in cases if case.with_ball is not None]
    return result | ({"with_ball": summary(truths, with_ball)} if with_ball else {})


def rows_of(told: dict[str, Any]) -> list[tuple[str, ...]]:
    """Rows of the table."""
    rows = []
    for name, both in told.items():
        if not isinstance(both, dict):
            continue
        printed = f" (printed {100 * both['printed_relative_error']:.2f} %)" if "printed_relative_error" in both else ""
        rows += [_row(f"{name}{printed}", ball, both[ball]) for ball in ("alone", "with_ball") if ball in both]
    return rows


def _row(name: str, ball: str, one: dict[str, Any]) -> tuple[str, ...]:
    flags = ", ".join(f"{flag} {count}" for flag, count in one["flags"].items()) or "none"
    begun = (name, "yes" if ball == "with_ball" else "no", str(one["cases"]), str(one["trusted"]))
    if "bias" not in one:
        return *begun, "", "", "", "", flags

    def held(level: str) -> str:
        low, high = one[f"coverage_{level}_wilson"]
        return f"{100 * one[f'coverage_{level}']:.1f} % ({100 * low:.1f} to {100 * high:.1f})"

    error, bias = (f"{100 * one[key]:+.2f} %" for key in ("mean_relative_error", "bias"))
    return *begun, error[1:], bias, held("50"), held("90"), flags


def main() -> int:
    """Print the judgement."""
    bench = Bench(__doc__, probe="tsis-direct", spheres=40, rigs=5, seed=1, ball=False)
    with progress_bar("pressing spheres") as progress:
        probe = tsis.load_probe(bench.probe)
        ball = ball_on(probe) if bench.ball else None
        result = run(probe, bench.spheres, bench.rigs, bench.seed, ball, progress)
    heads = (
        *("spheres", "ball", "cases", "trusted", "mean error", "bias"),
        *("50 % interval holds", "90 % interval holds", "flags"),
    )
    bench.table(
        f"{bench.probe}, presses of {FORCES_N[0]:g} and {FORCES_N[1]:g} N, seed {bench.seed}", heads, rows_of(result)
    )
    print(f"spheres that the fine model does not reach: {result['unsolved']}")
    print(f"seconds an estimate (median): {result['seconds_an_estimate']:.2f}")
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
