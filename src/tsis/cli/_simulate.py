"""``tsis simulate``: pressure and displacement of a press, and frames of a virtual gel sensor."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.cli._options import AsJson, DepthMm, DiameterMm, ForceN, PhantomName, ProbeOption, YoungKpa, chosen_probe
from tsis.cli._output import print_json
from tsis.cli._progress import waiting
from tsis.cli._simulate_gel import GelOrder, write_gel_frames
from tsis.present.page import Column, Table
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.model.press import PressField


SHOWN_RADII = 13
GEL = "Frames of a virtual gel sensor (--sensor)"


class Strain(StrEnum):
    """The strain model."""

    SMALL = "small"
    FINITE = "finite"


def simulate(
    *,
    phantom: PhantomName = "hardness-100",
    probe: ProbeOption = "tsis-2011",
    force_n: ForceN = 1.0,
    diameter_mm: DiameterMm = None,
    depth_mm: DepthMm = None,
    young_kpa: YoungKpa = None,
    strain: Annotated[
        Strain, typer.Option(help="finite: large deformations and sliding, seconds; small: linear, milliseconds.")
    ] = Strain.FINITE,
    show_catalog: Annotated[bool, typer.Option("--list", help="List the catalog's probes and phantoms.")] = False,
    sensor: Annotated[
        str | None,
        typer.Option(help="Press balls on this gel sensor instead and write its frames.", rich_help_panel=GEL),
    ] = None,
    ball_mm: Annotated[float, typer.Option(help="Diameter of the ball.", rich_help_panel=GEL)] = 10.0,
    ball_kpa: Annotated[
        float | None, typer.Option(help="Young's modulus of the ball; left out: rigid.", rich_help_panel=GEL)
    ] = None,
    presses: Annotated[
        int, typer.Option(help="Presses of the ball, at forces up to --force-n.", rich_help_panel=GEL)
    ] = 3,
    calibration_presses: Annotated[
        int, typer.Option(help="Presses of a rigid ball of 6 mm before.", rich_help_panel=GEL)
    ] = 8,
    drag: Annotated[
        float,
        typer.Option(
            help="Shear force along x over the force; a file with marker_pitch_mm shows it.", rich_help_panel=GEL
        ),
    ] = 0.0,
    seed: Annotated[int, typer.Option(help="Seed of gel, lamps, places and noise.", rich_help_panel=GEL)] = 1,
    out: Annotated[
        Path, typer.Option(help="Folder to write; a number is added when it exists.", rich_help_panel=GEL)
    ] = Path("virtual-gel"),
    as_json: AsJson = False,
) -> None:
    """Press a probe on a phantom, or with --sensor balls on a gel sensor, by finite elements."""
    if show_catalog:
        _catalog(as_json=as_json)
        return
    if sensor is not None:
        order = GelOrder(ball_mm, ball_kpa, force_n, presses, calibration_presses, seed, drag)
        write_gel_frames(sensor, order, out, as_json=as_json)
        return
    pressed = tsis.catalog.phantoms.phantom_variant(phantom, diameter_mm, depth_mm, young_kpa)
    chosen = chosen_probe(probe)
    with waiting(f"pressing at {strain} strain"):
        press: Callable[..., PressField] = partial(tsis.mechanics.press, chosen, strain=strain)
        if strain == Strain.FINITE and force_n > 0:
            press = tsis.mechanics.finite_strain.neo_hookean_press.PressSeries(chosen).press
        field, reference = (press(slab, force_n=force_n) for slab in (pressed, pressed.without_inclusion()))
    change = field.face_displacement_mm - reference.face_displacement_mm
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "simulate",
                probe=asdict(chosen),
                phantom=asdict(pressed),
                force_n=force_n,
                strain=strain,
                approach_mm=field.approach_mm,
                radius_mm=field.radius_mm,
                pressure_kpa=field.pressure_kpa,
                face_displacement_mm=field.face_displacement_mm,
                change_by_inclusion_mm=change,
            )
        )
        return
    quantities = {
        "radius": "mm",
        "pressure": "kPa",
        "face displacement": "um",
        "change by the inclusion": "um",
    }
    step = (len(field.radius_mm) - 1) // (SHOWN_RADII - 1)
    table = Table(
        title=f"{chosen.name} on {pressed.name}, {force_n:g} N: the glass travels {field.approach_mm:.3f} mm",
        columns=tuple(Column(label=label, unit=unit, form=".3f") for label, unit in quantities.items()),
        values=tuple(
            (field.radius_mm[i], field.pressure_kpa[i], 1000 * field.face_displacement_mm[i], 1000 * change[i])
            for i in range(0, len(field.radius_mm), step)
        ),
    )
    print_tables((table,))


def _catalog(*, as_json: bool) -> None:
    if as_json:
        probes = {name: asdict(tsis.catalog.load_probe(name)) for name in tsis.catalog.probes.list_probes()}
        phantoms = {name: asdict(tsis.catalog.load_phantom(name)) for name in tsis.catalog.phantoms.list_phantoms()}
        print_json(tsis.present.document.envelope("simulate", "list", probes=probes, phantoms=phantoms))
        return
    rows: list[tuple[str | float | None, ...]] = []
    for name in tsis.catalog.phantoms.list_phantoms():
        phantom = tsis.catalog.load_phantom(name)
        lump = phantom.inclusion
        sizes = ("", "", "") if lump is None else (lump.diameter_mm, lump.depth_mm, lump.young_kpa)
        rows.append((name, *sizes, ", ".join(phantom.assumed)))
    sizes_columns = (Column(label=label, unit=unit) for label, unit in (("d", "mm"), ("h", "mm"), ("E", "kPa")))
    columns: tuple[str | Column, ...] = ("name", *sizes_columns, "assumed, not printed in the source")
    probes_table = Table(
        title="Probes", columns=("name",), values=tuple((n,) for n in tsis.catalog.probes.list_probes())
    )
    print_tables((probes_table, Table(title="Phantoms", columns=columns, values=tuple(rows))))
