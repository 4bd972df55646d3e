"""``tsis examine``: what image files from any camera say, and what they cannot."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.calibration import read_usable_calibration
from tsis.cli._options import (
    AsJson,
    calibrated_probe,
    chosen_probe,
    chosen_scale,
    reference_forces,
    require_no_file,
    target_forces,
)
from tsis.cli._output import CommandOutcome, estimate_table, estimate_with_progress, publish
from tsis.cli._saving import KindOption, SaveOption, StoreOption, TargetOption, chosen_destination, publish_and_save
from tsis.errors import InputError
from tsis.imaging import match_light
from tsis.inclusion import InclusionPrior, ring_edges
from tsis.instrument import read_image
from tsis.report import (
    analyse_image,
    contact_report,
    envelope,
    estimate_document,
    estimate_messages,
    features_document,
    finding_notes,
    finding_rows,
    inclusion_report,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.model import Estimate, Probe, TactileImage


UNNAMED = "tsis-2011"  # the probe of calibrations that name none of the catalog
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
    match_lamps: Annotated[
        bool, typer.Option("--match-light", help="Scale the reference to the image's lamps; less than half is touched.")
    ] = False,
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration file of the probe; with it the inclusion is estimated.")
    ] = None,
    force_n: Annotated[
        list[float] | None, typer.Option(help="Force in newtons: one for all images, or one for each, in their order.")
    ] = None,
    plain: Annotated[
        list[Path] | None,
        typer.Option(help="Press on plain tissue with the same probe, for the estimate; one for each force is best."),
    ] = None,
    plain_force_n: Annotated[
        list[float] | None,
        typer.Option(help="Force of the presses on plain tissue, in their order; by default that of the images."),
    ] = None,
    probe: Annotated[
        str | None,
        typer.Option(
            help="Name in the catalog (tsis simulate --list), or a file of your own, as mine.toml.",
            show_default=f"the calibration's, else {UNNAMED}",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path(
        "tsis-examine"
    ),
    keep: SaveOption = False,
    store: StoreOption = None,
    kind: KindOption = None,
    number: TargetOption = None,
    as_json: AsJson = False,
) -> None:
    """Find the contact in image files and measure it; estimate the inclusion when the probe is calibrated."""
    if keep:
        require_no_file("--keep", probe)
    chosen = None if probe is None else chosen_probe(probe)
    if calibration is None and (plain or plain_force_n):
        raise InputError("--plain needs --calibration: without it no inclusion is estimated")
    if plain_force_n and not plain:
        raise InputError("--plain-force-n needs --plain, the presses whose force it tells")
    if calibration is not None and (reference is not None or invert or match_lamps):
        raise InputError(
            "--reference, --invert and --match-light are not used with --calibration: its background level is "
            "subtracted instead (for a press on plain tissue use --plain)"
        )
    if match_lamps and reference is None:
        raise InputError("--match-light needs --reference, the frame that it scales")
    if calibration is None and force_n:
        raise InputError("--force-n needs --calibration: without it a force tells nothing")
    if keep and calibration is None:
        raise InputError("--keep needs --calibration: without it there is no estimate to keep")
    given = None if calibration is None else read_usable_calibration(calibration)
    scale = chosen_scale(given, scale_mm)
    by_line = given is not None and not force_n and given.calibration.force_line is not None
    if given is not None and (scale is None or not (force_n or by_line)):
        raise InputError(
            "an estimate with --calibration needs --scale-mm and --force-n as well, where it holds neither scale nor "
            "force line"
        )
    forces = target_forces(force_n, len(images)) if force_n else [None] * len(images)
    frames = _read(images, forces, scale)
    untouched = None if reference is None else read_image(reference, mm_per_pixel=scale)
    provenance: dict[str, Any] = {
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "images": [{"name": frame.name, **frame.settings} for frame in frames],
        "reference": None if untouched is None else {"name": untouched.name, **untouched.settings},
        "mm_per_pixel": None if scale is None else list(scale),
        "invert": invert,
        "match_light": match_lamps,
        "calibration": None if given is None else given.citation(),
    }
    if given is None:
        publish(_contacts(frames, untouched, provenance, invert=invert, match=match_lamps), out, as_json=as_json)
    else:
        from tsis.records import SavableResult, require_savable  # loads the libraries of records

        plain = plain or []
        reference_force = (
            [None] * len(plain) if by_line else reference_forces(plain_force_n or (), force_n or (), len(plain))
        )
        reference_frames = _read(plain, reference_force, scale)
        if keep:
            require_savable([*frames, *reference_frames])
        destination = chosen_destination(keep, store, kind, number)
        pressed, response = given.pressed(frames)
        on_plain, reference_response = given.pressed(reference_frames)
        response = max(response, reference_response, key=lambda item: item.force_sd)
        if by_line:
            provenance["forces_n"] = {"by": "force line", "images": [frame.force_n for frame in pressed]}
        by, prior = chosen or calibrated_probe(response.probe, unnamed=UNNAMED), InclusionPrior()
        result = estimate_with_progress(pressed, probe=by, calibration=response, reference=on_plain, prior=prior)
        outcome = _inclusion(result, pressed, on_plain, by, prior, provenance)
        keepable = SavableResult(
            kind="inclusion",
            estimate=result,
            probe=by.name,
            calibration=given.calibration,
            frames={"target": frames, "plain": reference_frames},
            options={"prior": asdict(prior)},
        )
        publish_and_save(outcome, out, destination, keepable, as_json=as_json)


def _read(
    paths: Sequence[Path], forces: Sequence[float | None], scale: tuple[float, float] | None
) -> list[TactileImage]:
    return [read_image(path, mm_per_pixel=scale, force_n=force) for path, force in zip(paths, forces, strict=True)]


def _contacts(
    frames: Sequence[TactileImage],
    untouched: TactileImage | None,
    provenance: dict[str, Any],
    *,
    invert: bool,
    match: bool,
) -> CommandOutcome:
    findings = [
        analyse_image(
            frame,
            match_light(untouched, frame) if match and untouched is not None else untouched,
            invert=invert,
        )
        for frame in frames
    ]
    document = envelope(
        "examine",
        "contacts",
        images=[
            {"name": finding.image.name, "features": features_document(finding.features, finding.contact)}
            for finding in findings
        ],
        refused=[{"estimate": name, "reason": reason} for name, reason in REFUSED],
        provenance=provenance,
    )
    tables = []
    for finding in findings:
        table = Table("quantity", "value", title=escape(finding.image.name))
        for row in finding_rows(finding):
            table.add_row(*row)
        tables.append(table)
    notes = [note for finding in findings for note in finding_notes(finding)]
    notes += [f"Not estimated: {name}: {reason}." for name, reason in REFUSED]
    page = contact_report(findings, refused=REFUSED, provenance=provenance)
    return CommandOutcome(document=document, page=page, tables=tuple(tables), notes=tuple(notes))


def _inclusion(
    result: Estimate,
    frames: Sequence[TactileImage],
    on_plain: Sequence[TactileImage],
    probe: Probe,
    prior: InclusionPrior,
    provenance: dict[str, Any],
) -> CommandOutcome:
    names = ", ".join(f"{frame.name} ({frame.force_n:g} N)" for frame in frames)
    page = inclusion_report(
        result,
        title=f"Inclusion under {probe.name}",
        subtitle=names,
        targets=frames,
        references=on_plain,
        prior=prior,
        ring_edges_mm=ring_edges(probe),
        provenance=provenance,
    )
    document = envelope("examine", estimate=estimate_document(result), provenance=provenance)
    table = estimate_table(result, title=names)
    return CommandOutcome(document=document, page=page, tables=(table,), notes=estimate_messages(result))
