"""``tsis hardness --contacts``: Young's modulus from contacts that any program has read on a gel sensor."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.cli._output import leave, print_json
from tsis.cli._progress import waiting
from tsis.errors import InputError
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from tsis.hardness.posterior import HardnessPrior

PANEL = "Contacts of a gel sensor"
ContactsFile = Annotated[
    Path | None,
    typer.Option(
        "--contacts",
        help="CSV file with force_n and radius_mm or area_mm2, or depth_mm; also *_sd_mm, force_sd_n.",
        rich_help_panel=PANEL,
    ),
]
ContactsSensor = Annotated[
    str | None,
    typer.Option("--sensor", help="Gel sensor of the contacts: a name, or mine.toml.", rich_help_panel=PANEL),
]
CylinderLength = Annotated[
    float | None,
    typer.Option("--cylinder-mm", help="Length of the contact of a cylinder on its side.", rich_help_panel=PANEL),
]
FlatObject = Annotated[bool, typer.Option("--flat", help="The object is flat.", rich_help_panel=PANEL)]
BallContacts = Annotated[
    Path | None,
    typer.Option("--ball-contacts", help="CSV file of contacts with a rigid ball.", rich_help_panel=PANEL),
]
OneSequence = Annotated[
    bool,
    typer.Option("--sequence", help="The contacts are one press in the order of time.", rich_help_panel=PANEL),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactOptions:
    """What the command line says of contacts."""

    sensor: str | None
    force_n: list[float] | None
    radius_mm: float | None
    radius_sd_mm: float | None
    cylinder_mm: float | None
    flat: bool
    ball: Path | None
    ball_radius_mm: float | None
    sequence: bool


def hardness_from_contacts(path: Path, given: ContactOptions, *, prior: HardnessPrior | None, as_json: bool) -> None:
    """Estimate and print; the exit code is 3 where the result must not be trusted."""
    if given.sensor is None:
        raise InputError("--contacts needs --sensor, the gel sensor that was touched (tsis sensor show lists them)")
    if given.flat and given.cylinder_mm is not None:
        raise InputError("--flat and --cylinder-mm must not be given together: an object has one shape")
    shape = "flat" if given.flat else "sphere" if given.cylinder_mm is None else "cylinder"
    forces = given.force_n if given.force_n is None or len(given.force_n) > 1 else given.force_n[0]
    with waiting("estimating the modulus"):
        result = tsis.hardness.estimate_from_contacts(
            path,
            sensor=given.sensor,
            force=forces,
            geometry={
                "shape": shape,
                "radius_mm": given.radius_mm,
                "radius_sd_mm": given.radius_sd_mm,
                "length_mm": given.cylinder_mm,
            },
            reference=given.ball,
            reference_radius_mm=given.ball_radius_mm,
            prior=prior,
            sequence=given.sequence,
        )
    if as_json:
        withheld = result.withheld_reason("young_kpa")
        print_json(
            tsis.present.document.envelope(
                "hardness contacts",
                estimate=tsis.present.document.estimate_document(result, None),
                shore_converted=None if withheld else asdict(tsis.hardness.shore.shore(result.mean["young_kpa"])),
                provenance=dict(result.provenance),
            )
        )
    else:
        shown = tsis.present.hardness.hardness_table(result, title=f"Hardness by contacts of {given.sensor}")
        print_tables((shown,), tsis.present.hardness.hardness_notes(result))
    leave(trusted=result.trusted)
