"""``tsis examine``: contacts and inclusions in image files of any camera."""

from __future__ import annotations

from dataclasses import asdict, replace
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
    ShowPrior,
    calibrated_probe,
    chosen_prior,
    chosen_probe,
    chosen_scale,
    other_priors,
    read_frames,
    reference_forces,
    require_no_file,
    target_forces,
)
from tsis.cli.output import CommandOutcome, publish, surrogate_progress
from tsis.cli.saving import (
    KindOption,
    SaveOption,
    StoreOption,
    TargetOption,
    chosen_destination,
    publish_and_save,
    savable_result,
)
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.inclusion import InclusionPrior
    from tsis.inclusion.budget import UncertaintyBudget
    from tsis.inclusion.comparison import PressComparison
    from tsis.model.budget import QuantityBudget
    from tsis.model.calibration import Calibration
    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


PDF = "report.pdf"
UNNAMED = "tsis-2011"  # for calibrations that name no probe
REFUSED = (
    (
        "inclusion: diameter, depth, modulus",
        "needs a calibration of this probe (--calibration), the forces (--force-n) and the scale (--scale-mm)",
    ),
    ("force", "needs a force calibration of this probe and camera"),
    ("hardness of a touched object", "needs a calibration of this probe and two presses on the object: tsis hardness"),
)


def examine(
    images: Annotated[list[Path], typer.Argument(help="Frames of the pressed probe: PNG, JPEG, BMP or TIFF.")],
    *,
    reference: Annotated[
        Path | None, typer.Option(help="Frame of the untouched probe, subtracted from each image.")
    ] = None,
    scale_mm: Annotated[
        str | None, typer.Option(help="Millimetres per pixel on the face: one number, or x,y when they differ.")
    ] = None,
    invert: Annotated[bool, typer.Option("--invert", help="Light falls where the probe is pressed.")] = False,
    match_light: Annotated[
        bool, typer.Option("--match-light", help="Scale the reference to the image's lamps; less than half is touched.")
    ] = False,
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration file of the probe; with it the inclusion is estimated.")
    ] = None,
    force_n: Annotated[
        list[float] | None, typer.Option(help="Force in newtons: one for all images, or one for each, in their order.")
    ] = None,
    reference_presses: Annotated[
        list[Path] | None,
        typer.Option("--reference-press", help="Press on tissue without inclusion, same probe; best one per force."),
    ] = None,
    reference_force_n: Annotated[
        list[float] | None,
        typer.Option(help="Force of the reference presses, in their order; by default that of the images."),
    ] = None,
    probe: Annotated[
        str | None,
        typer.Option(
            help="Name in the catalog (tsis simulate --list), or a file of your own, as mine.toml.",
            show_default=f"the calibration's, else {UNNAMED}",
        ),
    ] = None,
    relative: Annotated[
        bool,
        typer.Option(
            "--relative",
            help="Estimate relative size and depth, and with two forces and a calibration relative hardness, against "
            "--reference, else against --reference-press.",
        ),
    ] = False,
    shape: Annotated[
        bool, typer.Option("--shape", help="Measure ellipse, roundness and outline of the lit area, against the same.")
    ] = False,
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
    """Find the contact in image files and measure it; estimate the inclusion when the probe is calibrated."""
    if save:
        require_no_file("--save", probe)
    chosen = None if probe is None else chosen_probe(probe)
    compared = relative or shape
    if compared:
        _require_comparable(reference, reference_presses, scale_mm, calibration, invert=invert)
    if calibration is None and not compared and (reference_presses or reference_force_n):
        raise InputError("--reference-press needs --calibration: without it no inclusion is estimated")
    if reference_force_n and not reference_presses:
        raise InputError("--reference-force-n needs --reference-press, the presses whose force it tells")
    if calibration is not None and ((reference is not None and not compared) or invert or match_light):
        raise InputError(
            "--reference, --invert and --match-light are not used with --calibration: its background level is "
            "subtracted instead (a press on tissue without inclusion is a --reference-press)"
        )
    if match_light and reference is None:
        raise InputError("--match-light needs --reference, the frame that it scales")
    if calibration is None and force_n and not compared:
        raise InputError("--force-n needs --calibration: without it a force is not used")
    if save and calibration is None:
        raise InputError("--save needs --calibration: without it there is no estimate to save")
    estimated = {"--budget": budget, "--pdf": pdf, "--prior": prior, "--tissue-kpa": tissue_kpa}
    for option in (name for name, value in estimated.items() if value and calibration is None):
        raise InputError(f"{option} needs --calibration: without it no inclusion is estimated")
    assumed = chosen_prior(prior, tissue_kpa)
    usable = None if calibration is None else tsis.calibration.frames.read_usable_calibration(calibration)
    scale = chosen_scale(usable, scale_mm)
    by_line = usable is not None and not force_n and usable.calibration.force_line is not None
    if usable is not None and (scale is None or not (force_n or by_line)):
        raise InputError(
            "an estimate with --calibration needs --scale-mm and --force-n, where it contains neither scale nor "
            "force line"
        )
    forces = target_forces(force_n, len(images)) if force_n else [None] * len(images)
    frames = read_frames(images, forces, scale)
    untouched = None if reference is None else tsis.calibration.frames.read_press_image(reference, mm_per_pixel=scale)
    provenance: dict[str, Any] = {
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "images": [{"name": frame.name, **frame.settings} for frame in frames],
        "reference": None if untouched is None else {"name": untouched.name, **untouched.settings},
        "mm_per_pixel": None if scale is None else list(scale),
        "invert": invert,
        "match_light": match_light,
        "calibration": None if usable is None else usable.citation(),
    }
    if usable is None:
        comparison = None
        if compared:
            on_tissue = read_frames(
                reference_presses or [],
                _forces_if_given(reference_force_n, force_n, len(reference_presses or [])),
                scale,
            )
            comparison = _compared(frames, untouched, on_tissue, None, relative=relative, shape=shape)
        outcome = _contacts(
            frames, untouched, provenance, invert=invert, match_light=match_light, comparison=comparison
        )
        publish(outcome, out, as_json=as_json)
    else:
        reference_presses = reference_presses or []
        reference_force = (
            [None] * len(reference_presses)
            if by_line
            else reference_forces(reference_force_n or (), force_n or (), len(reference_presses))
        )
        reference_frames = read_frames(reference_presses, reference_force, scale)
        if save:
            from tsis.records.importing import require_savable  # loads the libraries of records

            require_savable([*frames, *reference_frames])
        destination = chosen_destination(save, store, kind, number)
        pressed, response = usable.pressed(frames, on_tissue=True)
        on_reference, reference_response = usable.pressed(reference_frames, on_tissue=True)
        response = max(response, reference_response, key=lambda item: item.force_sd)
        if by_line:
            provenance["forces_n"] = {"by": "force line", "images": [frame.force_n for frame in pressed]}
        by = chosen or calibrated_probe(response.probe, unnamed=UNNAMED)
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
        of_forces = {
            frame.name: usable.force_budget(frame.force_n or 0.0, by_line=by_line)
            for frame in (*pressed, *on_reference)
            if budget
        }
        comparison = None
        if compared:
            if untouched is not None:
                usable.require_untouched([untouched])
            bare = None if untouched is None else usable.pressed([replace(untouched, force_n=0.0)])[0][0]
            comparison = _compared(pressed, bare, on_reference, response, relative=relative, shape=shape)
        outcome = _inclusion(
            shown, pressed, on_reference, by, assumed, provenance, comparison, budget=parts, forces=of_forces, pdf=pdf
        )
        savable = partial(
            savable_result,
            kind="inclusion",
            estimate=result,
            probe=by.name,
            calibration=usable.calibration,
            frames={"target": frames, "plain": reference_frames},
            options={"prior": asdict(assumed), "strain": result.provenance.get("strain", strain)},
        )
        publish_and_save(outcome, out, destination, savable, as_json=as_json)


def _forces_if_given(
    reference_force_n: Sequence[float] | None, force_n: Sequence[float] | None, presses: int
) -> Sequence[float | None]:
    """Force of each reference press, None where none is given."""
    return (
        reference_forces(reference_force_n or (), force_n or (), presses)
        if reference_force_n or force_n
        else [None] * presses
    )


def _require_comparable(
    reference: Path | None,
    reference_presses: list[Path] | None,
    scale_mm: str | None,
    calibration: Path | None,
    *,
    invert: bool,
) -> None:
    """Refuse frames that cannot be compared."""
    if reference is None and not reference_presses:
        raise InputError(
            "--relative and --shape compare each image: give the untouched probe as --reference, or reference presses "
            "at the forces of the images as --reference-press"
        )
    if calibration is None and reference is not None and reference_presses:
        raise InputError(
            "--relative and --shape compare with one kind of reference: give --reference or --reference-press"
        )
    if calibration is None and scale_mm is None:
        raise InputError("--relative and --shape need --scale-mm: they are lengths and areas in millimetres")
    if invert:
        raise InputError("--relative and --shape need light that grows where the probe is pressed; leave out --invert")


def _compared(
    frames: Sequence[TactileImage],
    untouched: TactileImage | None,
    on_reference: Sequence[TactileImage],
    calibration: Calibration | None,
    *,
    relative: bool,
    shape: bool,
) -> PressComparison:
    references, against = (on_reference, "plain tissue") if untouched is None else ([untouched], "untouched probe")
    return tsis.inclusion.comparison.compare_presses(
        frames, references, against=against, calibration=calibration, relative=relative, shape=shape
    )


def _contacts(
    frames: Sequence[TactileImage],
    untouched: TactileImage | None,
    provenance: dict[str, Any],
    *,
    invert: bool,
    match_light: bool,
    comparison: PressComparison | None = None,
) -> CommandOutcome:
    findings = [
        tsis.imaging.finding.analyse_image(
            frame,
            tsis.imaging.corrections.match_light(untouched, frame)
            if match_light and untouched is not None
            else untouched,
            invert=invert,
        )
        for frame in frames
    ]
    document = tsis.present.document.envelope(
        "examine",
        "contacts",
        images=[
            {
                "name": finding.image.name,
                "features": tsis.present.document.features_document(finding.features, finding.contact),
            }
            for finding in findings
        ],
        **({} if comparison is None else tsis.present.images.comparison_document(comparison)),
        refused=[{"estimate": name, "reason": reason} for name, reason in REFUSED],
        provenance=provenance,
    )
    page = tsis.present.images.contact_page(findings, refused=REFUSED, provenance=provenance, comparison=comparison)
    return CommandOutcome(document=document, page=page)


def _inclusion(
    result: Estimate,
    frames: Sequence[TactileImage],
    on_reference: Sequence[TactileImage],
    probe: Probe,
    prior: InclusionPrior,
    provenance: dict[str, Any],
    comparison: PressComparison | None,
    *,
    budget: UncertaintyBudget | None,
    forces: Mapping[str, QuantityBudget],
    pdf: bool,
) -> CommandOutcome:
    names = ", ".join(f"{frame.name} ({frame.force_n:g} N)" for frame in frames)
    page = tsis.present.inclusion.inclusion_page(
        result,
        title=f"Inclusion under {probe.name}",
        subtitle=names,
        targets=frames,
        references=on_reference,
        prior=prior,
        ring_edges_mm=tsis.inclusion.frames.ring_edges(probe),
        provenance=provenance,
        comparison=comparison,
        budget=budget,
        forces=forces,
    )
    compared = {} if comparison is None else tsis.present.images.comparison_document(comparison)
    listed = {} if budget is None else {"budget": tsis.present.document.budget_document(budget, forces)}
    document = tsis.present.document.envelope(
        "examine", estimate=tsis.present.document.estimate_document(result), **listed, **compared, provenance=provenance
    )
    return CommandOutcome(
        trusted=result.trusted,
        document=document,
        page=page,
        files={PDF: tsis.present.pdf.pdf_bytes(page)} if pdf else {},
    )
