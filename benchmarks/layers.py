"""Estimates on tissue with a superficial layer that all sites have in common: do they hold, or say why not?

    python -m benchmarks.layers --cases 6 --seed 91

Every press is solved with the layer in it, by finite elements on a finer mesh of another order than the estimator's
table, whose effect of a layer is linear in the logarithm of its modulus. Inclusion, tissue and all errors of the
virtual probe are drawn anew in each case; the same case has the same ones under every layer. The contact is whole and
the strain small, but for ``--strain finite``, where even tissue is solved at finite strain and the layer's change at
small strain is added.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, Choice, Several
from benchmarks.judgement import compared
from benchmarks.simulated_presses import DEFAULT, PROTOCOLS
from benchmarks.solved_data import solved_data
from benchmarks.worlds import FINE_MESH, UnevenProbe

import tsis
from tsis.errors import TsisError
from tsis.inclusion import InclusionPrior, estimate
from tsis.inclusion.prior import PARAMETERS
from tsis.mechanics.tissue_field import TissueFieldResponse
from tsis.virtual.examinations import draw_phantom

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.model.image import TactileImage
    from tsis.model.phantom import Phantom

LAYERS = (  # thickness in mm, modulus over the tissue's
    (1.0, 1.0),
    *((thickness, factor) for thickness in (0.5, 1.0, 2.0, 3.0) for factor in (0.3, 0.7, 1.4, 3.0, 10.0)),
)
CAUSE = "superficial_layer"


class LayeredProbe(UnevenProbe):
    """A virtual probe on tissue with a superficial layer."""

    def on_layer(self, phantom: Phantom, layer: tuple[float, float]) -> None:
        """Solve what a layer changes: the press with it less that without it, on one mesh."""
        stiffer, inclusion = self._stiffness, phantom.inclusion
        sphere = (
            None if inclusion is None else (inclusion.diameter_mm, inclusion.depth_mm, inclusion.young_kpa / stiffer)
        )
        presses = []
        for factor in (layer[1], 1.0):
            slab = TissueFieldResponse(
                self.probe,
                young_kpa=phantom.young_kpa / stiffer,
                thickness_mm=phantom.thickness_mm,
                poisson=phantom.poisson,
                inclusion=sphere,
                layer=(layer[0], factor),
                mesh=FINE_MESH,
            )
            presses.append(np.array(slab.press()))
        radius, _ = self._grid
        inside = radius <= self.probe.radius_mm
        change = presses[0] - presses[1]
        self._change = np.array(
            [[inside * np.interp(radius, slab.radius_mm, press) for press in part] for part in change]
        )


def pressed(
    layer: tuple[float, float], *, seed: int, index: int, strain: str, blank: bool
) -> tuple[Phantom, LayeredProbe, list[list[TactileImage]]]:
    """Tissue, probe and presses of target and reference site of one case."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    protocol, prior = PROTOCOLS[DEFAULT], InclusionPrior()
    phantom = draw_phantom(prior, rng)
    phantom = phantom.without_inclusion() if blank else phantom
    virtual = LayeredProbe(protocol.probe, rng=rng, strain=strain)
    nearby = phantom.young_kpa * float(np.exp(virtual.calibration.site_sd * rng.standard_normal()))
    presses = []
    for site in (phantom, replace(phantom.without_inclusion(), young_kpa=nearby)):
        with solved_data():
            virtual.on_layer(site, layer)
            presses.append([virtual.press(site, force_n=force) for force in protocol.forces_n])
    return phantom, virtual, presses


def judged(
    layer: tuple[float, float], *, seed: int, index: int, strain: str = "small", blank: bool = False
) -> dict[str, Any]:
    """One case under a layer."""
    line = {"layer": list(layer), "index": index, "blank": blank}
    try:
        phantom, virtual, presses = pressed(layer, seed=seed, index=index, strain=strain, blank=blank)
        result = estimate(
            presses[0], probe=virtual.probe, calibration=virtual.calibration, reference=presses[1], strain=strain
        )
    except TsisError as error:
        return line | {"refused": str(error)}
    presence = {"presence": result.presence, "presence_trusted": result.presence_trusted}
    if phantom.inclusion is None:
        return line | presence | {"trusted": result.trusted, "flags": list(result.flags)}
    return line | presence | compared(result, phantom.inclusion)


def row_of(layer: tuple[float, float], lines: Sequence[dict[str, Any]]) -> list[str]:
    """How many intervals held of each parameter, and held or untrusted with the cause; errors in deviations."""
    found = [line for line in lines if "rank" in line]
    name = "none" if layer[1] == 1.0 else f"{layer[0]:g} mm, {layer[1]:g} times"
    if not found:
        return [name, "0", *[""] * 6]
    held = np.abs(2 * np.array([line["rank"] for line in found]) - 1) <= 0.9
    mean, truth, sd = (np.array([line[part] for line in found]) for part in ("mean", "truth", "sd"))
    trusted = np.array([line["trusted"] for line in found])
    named = np.array([CAUSE in line["flags"] for line in found])
    errors = " / ".join(f"{part:+.1f}" for part in ((mean - truth) / sd).mean(axis=0))
    good = [int((column | (~trusted & named)).sum()) for column in held.T]
    flags = Counter(flag for line in found for flag in line["flags"] if not flag.endswith(("identified", "prior_end")))
    return [
        name,
        str(len(found)),
        " / ".join(str(int(column.sum())) for column in held.T),
        " / ".join(str(count) for count in good),
        errors,
        str(int((~trusted).sum())),
        str(int((~trusted & named).sum())),
        ", ".join(f"{flag} {count}" for flag, count in flags.most_common(2)),
    ]


def main() -> int:
    """Print the table, and the share that held or was untrusted with the cause."""
    bench = Bench(
        __doc__,
        cases=6,
        seed=91,
        strain=Choice(("small", "finite"), "small"),
        mm=Several(kind=float),
        factor=Several(kind=float),
    )
    layers = [
        layer
        for layer in LAYERS
        if (not bench.mm or layer[0] in bench.mm) and (not bench.factor or layer[1] in bench.factor)
    ]
    rows, whole = [], []
    for layer in layers:
        lines = [judged(layer, seed=bench.seed, index=index, strain=bench.strain) for index in range(bench.cases)]
        rows.append(row_of(layer, lines))
        whole += lines if layer[1] != 1.0 else []
    heads = (
        "layer",
        "cases",
        "d / h / E held",
        "held or cause named",
        "error, sd",
        "untrusted",
        "cause named",
        "flags",
    )
    title = f"{bench.cases} cases a layer, seed {bench.seed}, {bench.strain} strain, tsis {tsis.__version__}"
    bench.table(title, heads, rows)
    print(share(whole))
    return bench.end()


def share(lines: Sequence[dict[str, Any]]) -> str:
    """The share of all cases with a layer whose interval held or whose estimate named the layer."""
    found = [line for line in lines if "rank" in line]
    if not found:
        return "no case with a layer"
    held = np.abs(2 * np.array([line["rank"] for line in found]) - 1) <= 0.9
    named = np.array([not line["trusted"] and CAUSE in line["flags"] for line in found])
    good = (held | named[:, None]).mean(axis=0)
    parts = ", ".join(f"{name} {100 * value:.0f} %" for name, value in zip(PARAMETERS, good, strict=True))
    return f"held or untrusted with the cause, of {len(found)}: {parts}"


if __name__ == "__main__":
    sys.exit(main())
