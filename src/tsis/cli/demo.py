"""``tsis demo``: press a virtual phantom, show the images, estimate the inclusion.

With ``--seeds`` the demo is repeated with everything drawn anew, to count how often the intervals held.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import CALIBRATION_FILE, LARGEST_SEED
from tsis.cli.options import (
    AsJson,
    DepthMm,
    DiameterMm,
    ForcesN,
    PhantomName,
    ProbeOption,
    ProtocolName,
    ShowPrior,
    YoungKpa,
    chosen_prior,
    chosen_probe,
    inclusion_prior_option,
    is_careful,
    require_no_file,
    typed_options,
)
from tsis.cli.output import CommandOutcome, print_json, surrogate_progress
from tsis.cli.progress import progress_bar
from tsis.cli.saving import SaveOption, StoreOption, TargetOption, chosen_destination, publish_and_save, save_estimate
from tsis.errors import InputError
from tsis.present.page import Table
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.inclusion import InclusionPrior
    from tsis.model.image import TactileImage
    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe
    from tsis.virtual.probe import VirtualProbe


CONFIDENCE = 0.95
DEMO_PROBE, DEMO_PHANTOM, DEMO_PRIOR = "tsis-domed", "hardness-40", "breast-ex-vivo"


def repeat_demo(
    count: int,
    *,
    first_seed: int,
    probe: Probe,
    prior: InclusionPrior,
    forces_n: list[float],
    strain: str,
    as_json: bool,
) -> None:
    """Run the examinations, print the counts, and as JSON each case too."""
    examination = tsis.virtual.examinations.RepeatedExamination(
        probe=probe, prior=prior, forces_n=tuple(forces_n), strain=strain
    )
    with progress_bar(f"examining {count} virtual phantoms") as advance:
        cases = examination.run(count, first_seed=first_seed, progress=advance)
    counts = tsis.virtual.examinations.coverage_counts(cases)
    protocol: dict[str, Any] = {
        "probe": probe.name,
        "prior": prior_name(prior),
        "forces_n": list(forces_n),
        "strain": strain,
        "first_seed": first_seed,
    }
    protocol["command"] = _command(count, protocol)
    if as_json:
        print_json(
            tsis.present.document.envelope("demo", "seeds", protocol=protocol, counts=counts, examinations=cases)
        )
        return
    title = f"{count} examinations; {probe.name}, prior {protocol['prior']}"
    print_tables([_table(counts, title)], coverage_notes(counts))


def prior_name(prior: InclusionPrior) -> str:
    """The name of a prior; the default one has that of its file."""
    return prior.name or str(tsis.catalog.priors.list_inclusion_priors()[0])


def is_default_protocol(protocol: Mapping[str, Any]) -> bool:
    """Whether probe, prior, forces and strain are those of the stored run."""
    stored = tsis.virtual.examinations.stored_coverage()["protocol"]
    return all(protocol[name] == stored[name] for name in ("probe", "prior", "forces_n", "strain"))


def _command(count: int, protocol: Mapping[str, Any]) -> str:
    """The command that repeats a run: what differs from the defaults is named."""
    command = f"tsis demo --seeds {count} --seed {protocol['first_seed']}"
    if is_default_protocol(protocol):
        return command
    options = [("--probe", protocol["probe"]), ("--prior", protocol["prior"]), ("--strain", protocol["strain"])]
    options += [("--force-n", f"{force:g}") for force in protocol["forces_n"]]
    return " ".join([command, *(f"{name} {value}" for name, value in options)])


def _table(counts: Mapping[str, Any], title: str) -> Table:
    rows = []
    for kind, total in (("held", counts["answered"]), ("held_trusted", counts["trusted"])):
        for level, hits in counts[kind].items():
            which = "all" if kind == "held" else "trusted"
            shares = (_percentage(count, total) for count in hits.values())
            rows.append((f"{float(level):.0%}, {which} {total}", *shares))
    labels = (tsis.present.labels.quantity_of(name).label for name in tsis.inclusion.prior.PARAMETERS)
    return Table(title=title, columns=("interval", *(f"{label} held" for label in labels)), values=tuple(rows))


def _percentage(hits: int, total: int) -> str:
    """A share in per cent with its interval of 95 %, as Clopper and Pearson give it."""
    from scipy.stats import binomtest  # a start of the program loads no numerical library

    if total == 0:
        return ""
    among = binomtest(hits, total).proportion_ci(CONFIDENCE)
    return f"{100 * hits / total:.0f} % ({100 * among.low:.0f} to {100 * among.high:.0f})"


def coverage_notes(counts: Mapping[str, Any]) -> list[str]:
    """Messages about estimates that were untrusted or refused."""
    notes = [f"{counts['answered'] - counts['trusted']} of {counts['answered']} estimates are untrusted."]
    refused = sum(counts["refused"].values())
    if refused:
        reasons = ", ".join(f"{name} {count}" for name, count in counts["refused"].items())
        notes.append(f"{refused} of {counts['cases']} examinations were refused: {reasons}.")
    return notes


def stored_note() -> str:
    """One sentence on the stored run of 100 examinations: how often the intervals of 90 % held."""
    stored = tsis.virtual.examinations.stored_coverage()
    counts = stored["counts"]
    hits = ", ".join(f"{name} {count}" for name, count in counts["held"]["0.9"].items())
    return (
        f"With everything drawn anew, the 90 % interval held in so many of {counts['answered']} examinations: {hits} "
        f"({stored['protocol']['command']}, tsis {stored['tsis']})."
    )


ONE_EXAMINATION = ("phantom", "diameter_mm", "depth_mm", "young_kpa", "out", "save", "store", "number")


def demo(
    context: typer.Context,
    *,
    phantom: PhantomName = DEMO_PHANTOM,
    probe: ProbeOption = DEMO_PROBE,
    force_n: ForcesN = None,
    tissue_kpa: Annotated[
        float | None,
        typer.Option(help="Modulus of the tissue instead of 5 kPa; the inclusion's contrast and the prior's stay."),
    ] = None,
    protocol_name: ProtocolName = "usual",
    diameter_mm: DiameterMm = None,
    depth_mm: DepthMm = None,
    young_kpa: YoungKpa = None,
    seed: Annotated[int, typer.Option(help="Seed of every random error.", min=0, max=LARGEST_SEED)] = 0,
    strain: Annotated[
        str, typer.Option(help="Mechanics of presses and estimate: finite, seconds a press; small, tenths.")
    ] = "finite",
    seeds: Annotated[
        int | None,
        typer.Option(
            help="Repeat with this many seeds, everything drawn anew, and count how often the intervals held.", min=1
        ),
    ] = None,
    prior: Annotated[str | None, inclusion_prior_option("by phantom")] = None,
    show_prior: ShowPrior = False,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("tsis-demo"),
    save: SaveOption = False,
    store: StoreOption = None,
    number: TargetOption = None,
    as_json: AsJson = False,
) -> None:
    """Press a phantom with the virtual probe, estimate the inclusion, and write a page that shows it.

    Each force is pressed twice, on tissue without inclusion and on the phantom. The estimator does not know the true
    forces, gain and stiffness of the probe, nor the mesh of the virtual probe.

    The default prior is breast-ex-vivo for tsis-domed on hardness-40, else phantom-2011: most other phantoms are
    stiffer than breast-ex-vivo allows.

    With --seeds, each examination draws the inclusion and the tissue from the prior; nothing is written.
    """
    import numpy as np

    chosen = chosen_probe(probe)
    is_readme_demo = (probe, phantom) == (DEMO_PROBE, DEMO_PHANTOM)
    assumed = chosen_prior(prior or (DEMO_PRIOR if is_readme_demo else None), tissue_kpa)
    if seeds is not None:
        _require_only_seeds(context)
        repeat_demo(
            seeds,
            first_seed=seed,
            probe=chosen,
            prior=assumed,
            forces_n=_forces(force_n, protocol_name, chosen, assumed.tissue_young_kpa),
            strain=strain,
            as_json=as_json,
        )
        return
    target = tsis.catalog.phantoms.phantom_variant(phantom, diameter_mm, depth_mm, young_kpa)
    if tissue_kpa is not None:
        target = target.on_tissue(tissue_kpa) if young_kpa is None else replace(target, young_kpa=tissue_kpa)
    force_n = _forces(force_n, protocol_name, chosen, target.young_kpa)
    truth, forces = _truth(target), _named(force_n)
    if save:
        require_no_file("--save", probe)
    destination = chosen_destination(save, store, number=number)
    with progress_bar("tracing the light of the lamps") as advance:
        light = tsis.optics.face_light.irradiance(chosen, progress=advance)
    exposure = tsis.virtual.probe.exposure_for(max(force_n))
    virtual = tsis.virtual.VirtualProbe(
        chosen, rng=np.random.default_rng(seed), light=light, strain=strain, exposure=exposure
    )
    untouched = replace(virtual.no_contact(), name="untouched.png")
    references = _presses(virtual, target.without_inclusion(), forces, "reference")
    images = _presses(virtual, target, forces, "target")
    with surrogate_progress() as advance:
        result = tsis.inclusion.estimate(
            images,
            probe=chosen,
            calibration=virtual.calibration,
            reference=references,
            prior=assumed,
            progress=advance,
        )
    provenance = {"simulated": {"seed": seed, "phantom": asdict(target), "command": "tsis demo"}}
    pressed = f"{chosen.name}, {_pressed(force_n)}"
    protocol = {"probe": chosen.name, "prior": prior_name(assumed), "forces_n": force_n, "strain": strain}
    page = tsis.present.inclusion.inclusion_page(
        result,
        title=f"Virtual press on {target.name}",
        subtitle=f"{pressed}, each with a reference press on tissue without inclusion; simulated frames",
        targets=images,
        references=references,
        prior=assumed,
        ring_edges_mm=tsis.inclusion.frames.ring_edges(chosen),
        truth=truth,
        provenance=provenance,
        notes=(
            *_outside_the_prior(truth or {}, assumed),
            *((stored_note(),) if is_default_protocol(protocol) else ()),
        ),
    )
    calibration = tsis.calibration.file.ProbeCalibration(
        name=virtual.calibration.name, probe=chosen.name, response=virtual.calibration
    )
    keep = partial(
        save_estimate,
        kind="inclusion",
        estimate=result,
        probe=chosen.name,
        calibration=calibration,
        frames={"target": images, "plain": references, "untouched": [untouched]},
        options={"prior": asdict(assumed), "strain": result.provenance["strain"]},
        name=target.name,
        truth=truth or {},
    )
    outcome = CommandOutcome(
        trusted=result.trusted,
        document=tsis.present.document.envelope(
            "demo", **provenance, estimate=tsis.present.document.estimate_document(result, truth)
        ),
        page=page,
        files={
            **{frame.name: tsis.instrument.image_files.png_bytes(frame) for frame in (*images, *references)},
            "untouched.png": tsis.instrument.image_files.png_bytes(untouched),
            CALIBRATION_FILE: tsis.calibration.file.calibration_bytes(calibration),
        },
    )
    publish_and_save(outcome, out, destination, keep, as_json=as_json)


def _require_only_seeds(context: typer.Context) -> None:
    """Refuse options that --seeds, which draws each inclusion and writes nothing, would ignore."""
    typed = typed_options(context, ONE_EXAMINATION)
    if typed:
        raise InputError(
            f"--seeds draws every inclusion from the prior and writes nothing: leave out {' and '.join(typed)}"
        )


def _forces(stated: list[float] | None, protocol_name: str, probe: Probe, tissue_kpa: float) -> list[float]:
    """The forces of --force-n, or those of a protocol."""
    careful = is_careful(protocol_name)
    if not stated:
        return list(tsis.inclusion.tissue.protocol_forces(probe, tissue_young_kpa=tissue_kpa, careful=careful))
    if careful:
        raise InputError("--protocol careful chooses the forces: leave out --force-n")
    if len(set(stated)) < len(stated):
        raise InputError(f"--force-n must name different forces; got {', '.join(f'{force:g}' for force in stated)}")
    return stated


def _named(force_n: list[float]) -> dict[str, float]:
    """Forces by the names of their files; repeats are numbered."""
    before = [force_n[:index].count(force) for index, force in enumerate(force_n)]
    return {
        f"{force:g} N{f' {count + 1}' if count else ''}": force for force, count in zip(force_n, before, strict=True)
    }


def _pressed(force_n: list[float]) -> str:
    """Text of the forces."""
    each = dict.fromkeys(force_n)
    often = "" if len(each) == len(force_n) else f", {len(force_n) // len(each)} times each"
    return " and ".join(f"{force:g} N" for force in each) + often


def _presses(virtual: VirtualProbe, phantom: Phantom, forces: dict[str, float], what: str) -> list[TactileImage]:
    """One frame per force, named like its file."""
    return [
        replace(virtual.press(phantom, force_n=force), name=f"{what}-{name.replace(' N', 'N').replace(' ', '-')}.png")
        for name, force in forces.items()
    ]


def _truth(phantom: Phantom) -> dict[str, float] | None:
    if phantom.inclusion is None:
        return None
    return {name: getattr(phantom.inclusion, name) for name in tsis.inclusion.prior.PARAMETERS}


def _outside_the_prior(truth: dict[str, float], prior: InclusionPrior) -> tuple[str, ...]:
    """A message for each true value outside the prior."""
    ranges = {name: getattr(prior, name) for name in truth}
    return tuple(
        f"The true {name} {value:g} lies outside the prior's {ranges[name][0]:g} to {ranges[name][1]:g}: "
        "no interval can contain it."
        for name, value in truth.items()
        if not ranges[name][0] <= value <= ranges[name][1]
    )
