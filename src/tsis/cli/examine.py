"""``tsis examine``: the inclusion under a pressed probe."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.cli.options import (
    AsJson,
    InclusionPriorChoice,
    OtherPriors,
    PressForces,
    ReferenceForces,
    ReferencePresses,
    ScaleMm,
    ShowPrior,
    calibrated_probe,
    chosen_prior,
    chosen_probe,
    other_priors,
    require_no_file,
)
from tsis.cli.output import CommandOutcome, surrogate_progress
from tsis.cli.presses import Frames, folder_of, read_calibration_of, read_presses
from tsis.cli.saving import (
    KindOption,
    SaveOption,
    StoreOption,
    TargetOption,
    chosen_destination,
    publish_and_save,
    save_estimate,
)
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.calibration.frames import UsableCalibration
    from tsis.cli.presses import RawPresses
    from tsis.inclusion import InclusionPrior
    from tsis.model.image import TactileImage


PDF = "report.pdf"
UNNAMED = "tsis-2011"  # for calibrations that name no probe


def examine(
    images: Frames,
    *,
    scale_mm: ScaleMm = None,
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration file of the probe.", show_default="calibration.json of the folder")
    ] = None,
    force_n: PressForces = None,
    reference_presses: ReferencePresses = None,
    reference_force_n: ReferenceForces = None,
    probe: Annotated[
        str | None,
        typer.Option(
            help="Name in the catalog (tsis simulate --list), or a file of your own, as mine.toml.",
            show_default=f"the folder's or the calibration's, else {UNNAMED}",
        ),
    ] = None,
    strain: Annotated[
        str | None,
        typer.Option(help="Mechanics of the model: finite, or small for light presses.", show_default="as the presses"),
    ] = None,
    budget: Annotated[
        bool, typer.Option("--budget", help="List what the uncertainty of the estimate and of the forces consists of.")
    ] = False,
    pdf: Annotated[bool, typer.Option("--pdf", help=f"Write the page of the estimate as {PDF} too.")] = False,
    prior: InclusionPriorChoice = None,
    tissue_kpa: Annotated[
        float | None,
        typer.Option(help="Modulus of the tissue, as tsis protocol measured it; the prior's contrasts stay."),
    ] = None,
    ask_other_priors: OtherPriors = False,
    show_prior: ShowPrior = False,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path(
        "tsis-examine"
    ),
    save: SaveOption = False,
    store: StoreOption = None,
    kind: KindOption = None,
    number: TargetOption = None,
    as_json: AsJson = False,
) -> None:
    """Estimate the inclusion under the pressed probe, from a folder of frames or from single frames.

    A folder of tsis demo tells frames, forces, scale, calibration and prior; one of tsis acquire or tsis records export
    the same but for the prior. Options replace what the folder tells. tsis contacts measures frames without a
    calibration; tsis compare reads relative size, depth, hardness and shape.
    """
    if save:
        require_no_file("--save", probe)
    chosen = None if probe is None else chosen_probe(probe)
    assumed = _folder_prior(images) if prior is None and tissue_kpa is None else chosen_prior(prior, tissue_kpa)
    usable = read_calibration_of(images, calibration)
    if usable is None:
        raise InputError(
            "an estimate needs the calibration of the probe: give it as --calibration, or as calibration.json in the "
            "folder (tsis contacts measures the contact without one)"
        )
    presses = read_presses(
        images,
        calibration=usable,
        probe=chosen,
        scale_mm=scale_mm,
        force_n=force_n,
        reference_presses=reference_presses,
        reference_force_n=reference_force_n,
    )
    _require_force_and_scale(presses.images, usable)
    if save:
        from tsis.records.importing import require_savable  # loads the libraries of records

        require_savable([*presses.images, *presses.reference])
    destination = chosen_destination(save, store, kind, number)
    pressed, response = usable.pressed(presses.images, on_tissue=True)
    on_reference, reference_response = usable.pressed(presses.reference, on_tissue=True)
    response = max(response, reference_response, key=lambda item: item.force_sd)
    by = presses.probe or calibrated_probe(response.probe, unnamed=UNNAMED)
    given: dict[str, Any] = {
        "probe": by,
        "calibration": response,
        "reference": on_reference,
        "prior": assumed,
        "strain": strain,
    }
    with surrogate_progress() as progress:
        parts = tsis.inclusion.budget.uncertainty_budget(pressed, **given, progress=progress) if budget else None
        result = tsis.inclusion.estimate(pressed, **given, progress=progress) if parts is None else parts.estimate
    shown = result
    if ask_other_priors:
        shifts = tsis.inclusion.budget.prior_sensitivity(result, pressed, other_priors(assumed), **given)
        shown = tsis.inclusion.budget.with_prior_sensitivity(result, shifts)
    forces = {
        frame.name: usable.force_budget(frame.force_n or 0.0, by_line=raw.force_n is None)
        for raw, frame in zip((*presses.images, *presses.reference), (*pressed, *on_reference), strict=True)
        if budget
    }
    provenance = _provenance(presses, usable, pressed)
    page = tsis.present.inclusion.inclusion_page(
        shown,
        title=f"Inclusion under {by.name}",
        subtitle=", ".join(f"{frame.name} ({frame.force_n:g} N)" for frame in pressed),
        targets=pressed,
        references=on_reference,
        prior=assumed,
        ring_edges_mm=tsis.inclusion.frames.ring_edges(by),
        provenance=provenance,
        budget=parts,
        forces=forces,
    )
    listed = {} if parts is None else {"budget": tsis.present.document.budget_document(parts, forces)}
    outcome = CommandOutcome(
        trusted=shown.trusted,
        document=tsis.present.document.envelope(
            "examine", estimate=tsis.present.document.estimate_document(shown), **listed, provenance=provenance
        ),
        page=page,
        files={PDF: tsis.present.pdf.pdf_bytes(page)} if pdf else {},
    )
    keep = partial(
        save_estimate,
        kind="inclusion",
        estimate=result,
        probe=by.name,
        calibration=usable.calibration,
        frames={"target": presses.images, "plain": presses.reference},
        options={"prior": asdict(assumed), "strain": result.provenance.get("strain", strain)},
    )
    publish_and_save(outcome, out, destination, keep, as_json=as_json)


def _folder_prior(paths: Sequence[Path]) -> InclusionPrior:
    """The prior of the estimate whose frames the folder holds; without one the default prior."""
    folder = folder_of(paths)
    source = None if folder is None else folder / tsis.calibration.frames.RESULT_FILE
    if source is None or not source.is_file():
        return chosen_prior(None)
    with tsis.files.reading.written_by("tsis demo", source):
        stored = tsis.files.reading.read_object(source)["estimate"]["provenance"]["prior"]
        prior: InclusionPrior = tsis.files.json_values.from_json_value(tsis.inclusion.InclusionPrior, stored, "prior")
    return prior


def _require_force_and_scale(images: Sequence[TactileImage], usable: UsableCalibration) -> None:
    """Refuse frames of unknown force or scale, which the calibration does not give either."""
    scaled = usable.calibration.scale is not None or all(image.mm_per_pixel is not None for image in images)
    pressed = usable.calibration.force_line is not None or all(image.force_n is not None for image in images)
    missing = [name for name, known in (("--scale-mm", scaled), ("--force-n", pressed)) if not known]
    if missing:
        raise InputError(
            f"an estimate with --calibration needs {' and '.join(missing)}, which the frames and the calibration "
            "do not tell"
        )


def _provenance(presses: RawPresses, usable: UsableCalibration, pressed: Sequence[TactileImage]) -> dict[str, Any]:
    scale = pressed[0].mm_per_pixel
    provenance: dict[str, Any] = {
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "images": [{"name": frame.name, **frame.settings} for frame in presses.images],
        "mm_per_pixel": None if scale is None else list(scale),
        "calibration": usable.citation(),
    }
    if any(image.force_n is None for image in presses.images):
        provenance["forces_n"] = {"by": "force line", "images": [frame.force_n for frame in pressed]}
    return provenance
