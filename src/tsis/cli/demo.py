"""``tsis demo``: press a virtual phantom, see the image, read the inclusion with its uncertainty."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from tsis.cli.calibration_file import calibration_document
from tsis.cli.console_output import Outcome, progress_bar, publish
from tsis.cli.estimate_output import estimate_table, estimate_with_progress
from tsis.cli.targets import AsJson, DepthMm, DiameterMm, ForceN, PhantomName, ProbeName, YoungKpa, chosen_phantom
from tsis.inclusion import PARAMETERS, InclusionPrior, ring_edges
from tsis.instrument import png_bytes
from tsis.model import load_probe
from tsis.model.errors import InputError
from tsis.optics import irradiance
from tsis.report import inclusion_report
from tsis.report.document import envelope, estimate_document, json_bytes
from tsis.virtual import VirtualProbe

if TYPE_CHECKING:
    from tsis.model import Phantom

LARGEST_SEED = 2**63 - 1


def demo(
    *,
    phantom: PhantomName = "hardness-100",
    probe: ProbeName = "tsis-2011",
    force_n: ForceN = 1.0,
    diameter_mm: DiameterMm = None,
    depth_mm: DepthMm = None,
    young_kpa: YoungKpa = None,
    seed: Annotated[int, typer.Option(help="Seed of every random error.", min=0, max=LARGEST_SEED)] = 1,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("tsis-demo"),
    as_json: AsJson = False,
) -> None:
    """Press a phantom with the virtual probe, estimate the inclusion, and write a page that shows it.

    Two presses are taken, one on the phantom and one on plain tissue. The estimator knows neither the true forces, the
    true gain nor the mesh of the virtual probe.
    """
    target = chosen_phantom(phantom, diameter_mm, depth_mm, young_kpa)
    truth = _truth(target)
    chosen, prior = load_probe(probe), InclusionPrior()
    with progress_bar("tracing the light of the lamps") as advance:
        light = irradiance(chosen, progress=advance)
    virtual = VirtualProbe(chosen, rng=np.random.default_rng(seed), light=light)
    untouched = virtual.no_contact()
    reference = virtual.press(target.without_inclusion(), force_n=force_n)
    image = virtual.press(target, force_n=force_n)
    result = estimate_with_progress(
        [image], probe=chosen, calibration=virtual.calibration, reference=[reference], prior=prior
    )
    provenance = {"simulated": {"seed": seed, "phantom": asdict(target), "command": "tsis demo"}}
    page = inclusion_report(
        result,
        title=f"Virtual press on {target.name}",
        subtitle=f"{chosen.name}, {force_n:g} N, one press and one reference on plain tissue; simulated frames",
        target=image,
        reference=reference,
        prior=prior,
        ring_edges_mm=ring_edges(chosen),
        truth=truth,
        provenance=provenance,
    )
    outcome = Outcome(
        document=envelope("demo", **provenance, estimate=estimate_document(result, truth)),
        page=page,
        tables=(estimate_table(result, title=f"{target.name}, {force_n:g} N", truth=truth),),
        notes=(*result.notes, *_outside_the_prior(truth, prior)),
        files={
            "target.png": png_bytes(image),
            "reference.png": png_bytes(reference),
            "untouched.png": png_bytes(untouched),
            "calibration.json": json_bytes(calibration_document(virtual.calibration)),
        },
    )
    publish(outcome, out, as_json=as_json)


def _truth(phantom: Phantom) -> dict[str, float]:
    if phantom.inclusion is None:
        raise InputError(f"phantom must hold an inclusion to estimate; got {phantom.name!r} (try hardness-100)")
    return {name: getattr(phantom.inclusion, name) for name in PARAMETERS}


def _outside_the_prior(truth: dict[str, float], prior: InclusionPrior) -> tuple[str, ...]:
    """One sentence for each true value that no interval can hold, because the prior excludes it."""
    ranges = {name: getattr(prior, name) for name in truth}
    return tuple(
        f"The true {name} {value:g} lies outside the prior's {ranges[name][0]:g} to {ranges[name][1]:g}: "
        "no interval can hold it."
        for name, value in truth.items()
        if not ranges[name][0] <= value <= ranges[name][1]
    )
