"""``tsis protocol``: the forces of an examination."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.cli.options import AsJson, ProtocolName, calibrated_probe, chosen_probe, chosen_scale, is_careful, read_frames
from tsis.cli.output import CommandResult, Out, show_result
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.inclusion.tissue import TissueModulus
    from tsis.model.probe import Probe


DOMED = "tsis-domed"
NOT_ON_TISSUE = (
    "The press does not look like one on even tissue without an inclusion: press another place lightly, or give the "
    "modulus as --tissue-kpa."
)


def protocol(
    image: Annotated[
        Path | None, typer.Argument(help="Frame of a light press on tissue without an inclusion, 0.2 N or so.")
    ] = None,
    *,
    calibration: Annotated[Path | None, typer.Option(help="Calibration file of the probe.")] = None,
    force_n: Annotated[float | None, typer.Option(help="Force of the light press in newtons.")] = None,
    scale_mm: Annotated[
        str | None, typer.Option(help="Millimetres per pixel on the face: one number, or x,y when they differ.")
    ] = None,
    tissue_kpa: Annotated[
        float | None, typer.Option(help="Modulus of the tissue where it is known, kPa; instead of a frame.")
    ] = None,
    thickness_mm: Annotated[float, typer.Option(help="Thickness of the tissue, mm.")] = 30.0,
    probe: Annotated[
        str | None,
        typer.Option(
            help="Name in the catalog, or a file of your own.", show_default="the calibration's, else tsis-domed"
        ),
    ] = None,
    protocol_name: ProtocolName = "usual",
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Choose the forces of an examination by the tissue: from one light press, or from a known modulus."""
    if (image is None) == (tissue_kpa is None):
        raise InputError("tsis protocol needs either the frame of a light press or --tissue-kpa")
    if image is None:
        used, tissue = chosen_probe(probe or DOMED), None
    else:
        used, tissue = _light_press(image, calibration, force_n, scale_mm, thickness_mm=thickness_mm, probe=probe)
    young_kpa = tissue_kpa if tissue is None else tissue.young_kpa if tissue.trusted else None
    forces: tuple[float, ...] = ()
    if young_kpa is not None:
        forces = tsis.inclusion.tissue.protocol_forces(
            used, tissue_young_kpa=young_kpa, thickness_mm=thickness_mm, careful=is_careful(protocol_name)
        )
    document = tsis.present.document.envelope(
        "protocol",
        probe=used.name,
        thickness_mm=thickness_mm,
        tissue=None
        if young_kpa is None
        else {"young_kpa": young_kpa, "interval_kpa": None if tissue is None else list(tissue.interval_kpa)},
        trusted=young_kpa is not None,
        protocol=protocol_name,
        operator_s=tsis.inclusion.tissue.operator_time_s(len(forces)) if forces else None,
        forces_n=list(forces),
    )
    result = CommandResult(document=document, tables=(), notes=_protocol_notes(young_kpa, tissue, forces))
    show_result(result, out, as_json=as_json, trusted=young_kpa is not None)


def _light_press(
    image: Path,
    calibration: Path | None,
    force_n: float | None,
    scale_mm: str | None,
    *,
    thickness_mm: float,
    probe: str | None,
) -> tuple[Probe, TissueModulus]:
    if calibration is None:
        raise InputError("a light press needs --calibration, that of the probe")
    usable = tsis.calibration.frames.load_calibration(calibration)
    scale = chosen_scale(usable, scale_mm)
    by_line = force_n is None and usable.calibration.force_line is not None
    if scale is None or not (force_n or by_line):
        raise InputError(
            "a light press needs --scale-mm and --force-n, where the calibration contains neither scale nor force line"
        )
    (pressed,), response = usable.pressed(read_frames([image], [force_n], scale), on_tissue=True)
    used = calibrated_probe(response.probe, unnamed=DOMED) if probe is None else chosen_probe(probe)
    found = tsis.inclusion.tissue.tissue_modulus(pressed, probe=used, calibration=response, thickness_mm=thickness_mm)
    return used, found


def _protocol_notes(young_kpa: float | None, tissue: TissueModulus | None, forces: Sequence[float]) -> tuple[str, ...]:
    if young_kpa is None:
        return (NOT_ON_TISSUE,)
    between = (
        "" if tissue is None else f", 90 % interval {tissue.interval_kpa[0]:.3g} to {tissue.interval_kpa[1]:.3g} kPa"
    )
    each = tuple(dict.fromkeys(forces))
    shown = " and ".join(f"{force:g} N" for force in each)
    often = "" if len(each) == len(forces) else f", {len(forces) // len(each)} times each in turn"
    minutes = tsis.inclusion.tissue.operator_time_s(len(forces)) / 60
    return (
        f"Tissue: {young_kpa:.3g} kPa{between}.",
        f"Press at {shown}{often}, on the target and on tissue without an inclusion: about {minutes:.0f} minutes.",
        f"Then estimate with: tsis examine FRAME... --tissue-kpa {young_kpa:.3g}",
    )
