"""What the estimate says where its model does not hold: a flag, a refusal, or a wrong number?

    python -m benchmarks.held_out [--protocol domed] [--seed 1]

Each condition is one examination of tissue of 5 kPa, 30 mm thick, by a virtual probe with all its errors; what is wrong
about it stands in its name. Conditions in three dimensions need NGSolve, and flat probes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, Several
from benchmarks.simulated_presses import PROTOCOLS, SMALL, Protocol, SimulatedCase

from tsis.catalog.probes import load_probe
from tsis.cli.progress import progress_bar
from tsis.errors import TsisError
from tsis.inclusion import estimate
from tsis.inclusion.prior import PARAMETERS
from tsis.model.phantom import Inclusion, Phantom
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage

LUMP = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
TISSUE = Phantom(young_kpa=5.0, thickness_mm=30.0)
EXPOSURE = 3.0  # times as long as the camera's range allows for
BEYOND_N = 15.0
BROKE = "BROKE"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Condition:
    """Something that the model does not know of.

    Attributes
    ----------
    name
        What is wrong.
    make
        The examination, given the protocol and an rng.
    needs_flat
        Whether only flat probes can be pressed so here.
    """

    name: str
    make: Callable[[Protocol, np.random.Generator], SimulatedCase]
    needs_flat: bool = False


def pressed(phantoms: Sequence[Phantom], protocol: Protocol, rng: np.random.Generator) -> SimulatedCase:
    """Press a phantom for each target frame in turn; the reference is plain tissue like that of the first."""
    virtual = VirtualProbe(protocol.probe, rng=rng, strain="small")
    forces = protocol.forces_n * (len(phantoms) // len(protocol.forces_n))
    site = phantoms[0].without_inclusion()
    return SimulatedCase(
        phantom=phantoms[0],
        frames=tuple(virtual.press(one, force_n=force) for one, force in zip(phantoms, forces, strict=True)),
        references=tuple(virtual.press(site, force_n=force) for force in protocol.forces_n)
        if protocol.with_reference
        else (),
        calibration=virtual.calibration,
    )


def always(phantom: Phantom) -> Callable[[Protocol, np.random.Generator], SimulatedCase]:
    """One phantom under all target frames."""
    return lambda protocol, rng: pressed(len(protocol.forces_n) * [phantom], protocol, rng)


def lumps(*inclusions: Inclusion, young_kpa: float = TISSUE.young_kpa) -> Phantom:
    """Tissue with inclusions, or with none."""
    first = inclusions[0] if inclusions else None
    return replace(TISSUE, young_kpa=young_kpa, inclusion=first, more_inclusions=inclusions[1:])


def wrong_tissue(young_kpa: float, protocol: Protocol, rng: np.random.Generator) -> SimulatedCase:
    """Tissue of another modulus; the reference site is of the same tissue."""
    return always(lumps(LUMP, young_kpa=young_kpa))(protocol, rng)


def contradictory(protocol: Protocol, rng: np.random.Generator) -> SimulatedCase:
    """Half of the target frames show another inclusion."""
    other = lumps(replace(LUMP, diameter_mm=6.0, depth_mm=9.0))
    several = len(protocol.forces_n) > 1
    return pressed([lumps(LUMP), other] if several else len(protocol.forces_n) * [lumps(LUMP), other], protocol, rng)


def edited(
    change: Callable[[TactileImage], TactileImage], protocol: Protocol, rng: np.random.Generator
) -> SimulatedCase:
    """An ordinary examination whose target frames were changed afterwards."""
    case = always(lumps(LUMP))(protocol, rng)
    return replace(case, frames=tuple(change(frame) for frame in case.frames))


def overexposed(frame: TactileImage) -> TactileImage:
    """The frame as a camera would deliver it that gathers light for too long."""
    return replace(frame, grey=np.minimum(EXPOSURE * frame.grey, frame.full_scale))


def untouched(gauge_n: float | None, protocol: Protocol, rng: np.random.Generator) -> SimulatedCase:
    """The first target frame is that of an untouched probe; the gauge reads ``gauge_n``, or the truth."""
    case = always(lumps(LUMP))(protocol, rng)
    dark = VirtualProbe(protocol.probe, rng=rng, strain="small").no_contact()
    dark = dark if gauge_n is None else replace(dark, force_n=gauge_n)
    return replace(case, frames=(dark, *case.frames[1:]))


def of_another_probe(protocol: Protocol, rng: np.random.Generator) -> SimulatedCase:
    """The calibration is that of the catalog's other probe."""
    case = always(lumps(LUMP))(protocol, rng)
    other = "tsis-2011" if protocol.probe_name == "tsis-domed" else "tsis-domed"
    return replace(case, calibration=VirtualProbe(load_probe(other), rng=rng, strain="small").calibration)


ELLIPSOID = replace(LUMP, semi_axes_mm=(7.0, 3.5, 3.5))
BESIDE = replace(LUMP, diameter_mm=7.0)
CONDITIONS = (
    Condition(name="nothing wrong", make=always(lumps(LUMP))),
    Condition(name="tissue 30 % stiffer", make=partial(wrong_tissue, 1.3 * TISSUE.young_kpa)),
    Condition(name="tissue 30 % softer", make=partial(wrong_tissue, 0.7 * TISSUE.young_kpa)),
    Condition(name="no inclusion", make=always(lumps())),
    Condition(name="inclusion softer than the prior", make=always(lumps(replace(LUMP, young_kpa=20.0)))),
    Condition(name="inclusion stiffer than the prior", make=always(lumps(replace(LUMP, young_kpa=300.0)))),
    Condition(name="flat spheroid 14 x 14 x 6 mm", make=always(lumps(replace(LUMP, semi_axes_mm=(7.0, 7.0, 3.0))))),
    Condition(name="ellipsoid 14 x 7 x 7 mm", make=always(lumps(ELLIPSOID)), needs_flat=True),
    Condition(name="1 mm off the axis", make=always(lumps(replace(LUMP, offset_mm=(1.0, 0.0)))), needs_flat=True),
    Condition(name="3 mm off the axis", make=always(lumps(replace(LUMP, offset_mm=(3.0, 0.0)))), needs_flat=True),
    Condition(
        name="two of 7 mm, 9 mm apart",
        make=always(lumps(replace(BESIDE, offset_mm=(-4.5, 0.0)), replace(BESIDE, offset_mm=(4.5, 0.0)))),
        needs_flat=True,
    ),
    Condition(name="frames of two different inclusions", make=contradictory),
    Condition(name="overexposed", make=partial(edited, overexposed)),
    Condition(name="untouched, gauge reads 0 N", make=partial(untouched, None)),
    Condition(name="untouched, gauge reads 1 N", make=partial(untouched, 1.0)),
    Condition(name="calibration of another probe", make=of_another_probe),
    Condition(name=f"gauge reads {BEYOND_N:g} N", make=partial(edited, lambda frame: replace(frame, force_n=BEYOND_N))),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What was said about one condition: an estimate, or why there is none; the truth of the first target frame."""

    condition: str
    truth: Inclusion | None
    said: Estimate | str


def run(protocol: Protocol, seed: int) -> Iterator[Answer]:
    """Every condition that the protocol's probe can be pressed in; each has an rng of its own."""
    for number, condition in enumerate(CONDITIONS):
        if condition.needs_flat and protocol.probe.face_curvature_mm is not None:
            continue
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
        case = condition.make(protocol, rng)
        yield Answer(condition=condition.name, truth=case.phantom.inclusion, said=said_about(case, protocol))


def said_about(case: SimulatedCase, protocol: Protocol) -> Estimate | str:
    """The estimate, the sentence that refuses it, or what broke."""
    try:
        return estimate(
            case.frames,
            probe=protocol.probe,
            calibration=case.calibration,
            reference=case.references,
            strain=protocol.strain,
        )
    except TsisError as refusal:
        return f"refused: {refusal}"
    except Exception as crash:  # whatever breaks is a finding of this benchmark
        return f"{BROKE}: {type(crash).__name__}: {crash}"


def row(answer: Answer) -> list[str]:
    """Truth, mean and 90 % interval of each parameter, and flags; or the refusal."""
    if isinstance(answer.said, str):
        return [answer.condition, "", "", "", answer.said]
    interval, mean = answer.said.untrusted.interval(0.9), answer.said.untrusted.mean
    cells = []
    for name in PARAMETERS:
        low, high = interval[name]
        true = "-" if answer.truth is None else f"{getattr(answer.truth, name):.4g}"
        cells.append(f"{true}: {mean[name]:.3g} ({low:.3g} to {high:.3g})")
    trust = "" if answer.said.trusted else "not to be trusted: "
    return [answer.condition, *cells, trust + (", ".join(answer.said.flags) or "no flag")]


def main() -> int:
    """Print a table a protocol; the exit code is 1 when the estimator broke instead of refusing."""
    bench = Bench(__doc__, protocol=Several([one.name for one in SMALL]), seed=1)
    broke = False
    for name in bench.protocol or [one.name for one in SMALL]:
        rows: list[list[str]] = []
        with progress_bar(name) as progress:
            for answer in run(PROTOCOLS[name], bench.seed):
                rows.append(row(answer))
                progress(len(rows), len(CONDITIONS))
        broke |= any(line[-1].startswith(BROKE) for line in rows)
        title = f"{PROTOCOLS[name].described}; truth: posterior mean (90 % interval)"
        bench.table(title, ("condition", "d mm", "h mm", "E kPa", "said"), rows)
    return bench.end() or int(broke)


if __name__ == "__main__":
    sys.exit(main())
