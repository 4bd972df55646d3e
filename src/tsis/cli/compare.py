"""``tsis compare``: relative size, depth and hardness, and the shape of the lit area."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.cli.options import AsJson, PressForces, ReferenceForces, ReferencePresses, ScaleMm
from tsis.cli.output import CommandOutcome, publish
from tsis.cli.presses import Frames, read_calibration_of, read_presses
from tsis.errors import InputError

if TYPE_CHECKING:
    from tsis.cli.presses import RawPresses


def compare(
    images: Frames,
    *,
    reference: Annotated[
        Path | None, typer.Option(help="Frame of the untouched probe to compare with; it takes precedence.")
    ] = None,
    reference_presses: ReferencePresses = None,
    force_n: PressForces = None,
    reference_force_n: ReferenceForces = None,
    scale_mm: ScaleMm = None,
    calibration: Annotated[
        Path | None,
        typer.Option(
            help="Calibration file of the probe: with it and two forces, relative hardness too.",
            show_default="calibration.json of the folder",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path(
        "tsis-compare"
    ),
    as_json: AsJson = False,
) -> None:
    """Read relative size, depth and hardness of presses, and ellipse, roundness and outline of the lit area.

    Each press is compared with the untouched probe, or with presses on tissue without inclusion at its force within
    5 %. The readings are for comparisons with each other only.
    """
    if calibration is None and reference is not None and reference_presses:
        raise InputError("presses are compared with one kind of reference: give --reference or --reference-press")
    usable = read_calibration_of(images, calibration)
    presses = read_presses(
        images,
        calibration=usable,
        scale_mm=scale_mm,
        force_n=force_n,
        reference=reference,
        reference_presses=reference_presses,
        reference_force_n=reference_force_n,
    )
    on_tissue = reference is None and bool(presses.reference)
    if not presses.reference and not presses.untouched:
        raise InputError(
            "each press is compared: give the untouched probe as --reference, or reference presses at the forces of "
            "the images as --reference-press"
        )
    if (usable is None or usable.calibration.scale is None) and any(
        image.mm_per_pixel is None for image in presses.images
    ):
        raise InputError("a comparison needs --scale-mm: its readings are lengths and areas in millimetres")
    comparison = _compared(presses, on_tissue=on_tissue)
    provenance: dict[str, Any] = {
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "images": [{"name": frame.name, **frame.settings} for frame in presses.images],
        "reference": [
            {"name": frame.name, **frame.settings} for frame in (presses.reference if on_tissue else presses.untouched)
        ],
        "calibration": None if usable is None else usable.citation(),
    }
    outcome = CommandOutcome(
        document=tsis.present.document.envelope(
            "compare", **tsis.present.images.comparison_document(comparison), provenance=provenance
        ),
        page=tsis.present.images.comparison_page(
            comparison, names=[frame.name for frame in presses.images], provenance=provenance
        ),
    )
    publish(outcome, out, as_json=as_json)


def _compared(presses: RawPresses, *, on_tissue: bool) -> tsis.inclusion.comparison.PressComparison:
    """The comparison, of frames that the calibration corrects where there is one."""
    references = presses.reference if on_tissue else [replace(frame, force_n=0.0) for frame in presses.untouched[:1]]
    images, usable, response = presses.images, presses.calibration, None
    if usable is not None:
        if not on_tissue:
            usable.require_untouched(references)
        images, response = usable.pressed(images, on_tissue=True)
        references, of_reference = usable.pressed(references, on_tissue=on_tissue)
        response = max(response, of_reference, key=lambda item: item.force_sd) if on_tissue else response
    return tsis.inclusion.comparison.compare_presses(
        images,
        references,
        against="plain tissue" if on_tissue else "untouched probe",
        calibration=response,
    )
