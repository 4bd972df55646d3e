"""``tsis simulate``: pressure and displacement of a press, and frames of a virtual gel sensor."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer
from rich.table import Table

import tsis
from tsis.cli._options import AsJson, DepthMm, DiameterMm, ForceN, PhantomName, ProbeOption, YoungKpa, chosen_probe
from tsis.cli._output import (
    RESULT,
    npy_bytes,
    people,
    plain_json_bytes,
    print_json,
    print_notice,
    print_tables,
    result_bytes,
)
from tsis.cli._progress import waiting

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.model import PressField
    from tsis.virtual import RenderedPress, VirtualGelSensor


SHOWN_RADII = 13
GEL = "Frames of a virtual gel sensor (--sensor)"
GAUGE_SD, CALIPER_MM = 0.01, 0.1  # relative error of a force gauge; step of a caliper


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
        if ball_kpa is not None:
            tsis.model.require_number("--ball-kpa", ball_kpa, 1.0, 1e5, hint="kilopascals")
        tsis.model.require_number("--ball-mm", ball_mm, 1.0, 40.0, hint="millimetres")
        tsis.model.require_number("--force-n", force_n, 0.01, 50.0, hint="newtons")
        tsis.model.require_integer("--presses", presses, 1, 20)
        tsis.model.require_integer("--calibration-presses", calibration_presses, 0, 60)
        _gel_frames(
            sensor, GelOrder(ball_mm, ball_kpa, force_n, presses, calibration_presses, seed), out, as_json=as_json
        )
        return
    pressed = tsis.catalog.phantom_variant(phantom, diameter_mm, depth_mm, young_kpa)
    chosen = chosen_probe(probe)
    with waiting(f"pressing at {strain} strain"):
        press: Callable[..., PressField] = partial(tsis.mechanics.press, chosen, strain=strain)
        if strain == Strain.FINITE and force_n > 0:
            press = tsis.mechanics.finite_strain.PressSeries(chosen).press
        field, reference = (press(slab, force_n=force_n) for slab in (pressed, pressed.without_inclusion()))
    change = field.face_displacement_mm - reference.face_displacement_mm
    if as_json:
        print_json(
            tsis.report.envelope(
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
    console = people()
    table = Table(title=f"{chosen.name} on {pressed.name}, {force_n:g} N: the glass travels {field.approach_mm:.3f} mm")
    for heading in ("radius / mm", "pressure / kPa", "face displacement / um", "change by the inclusion / um"):
        table.add_column(heading, justify="right")
    step = (len(field.radius_mm) - 1) // (SHOWN_RADII - 1)
    for i in range(0, len(field.radius_mm), step):
        numbers = (field.radius_mm[i], field.pressure_kpa[i], 1000 * field.face_displacement_mm[i], 1000 * change[i])
        table.add_row(*(f"{number:.3f}" for number in numbers))
    console.print(table)
    print_notice(console)


def _catalog(*, as_json: bool) -> None:
    if as_json:
        probes = {name: asdict(tsis.catalog.load_probe(name)) for name in tsis.catalog.list_probes()}
        phantoms = {name: asdict(tsis.catalog.load_phantom(name)) for name in tsis.catalog.list_phantoms()}
        print_json(tsis.report.envelope("simulate", "list", probes=probes, phantoms=phantoms))
        return
    console = people()
    console.print("Probes:", ", ".join(tsis.catalog.list_probes()))
    table = Table(title="Phantoms")
    for heading in ("name", "d / mm", "h / mm", "E / kPa", "assumed, not printed in the source"):
        table.add_column(heading)
    for name in tsis.catalog.list_phantoms():
        phantom = tsis.catalog.load_phantom(name)
        lump = phantom.inclusion
        sizes = ("", "", "") if lump is None else (f"{lump.diameter_mm:g}", f"{lump.depth_mm:g}", f"{lump.young_kpa:g}")
        table.add_row(name, *sizes, ", ".join(phantom.assumed))
    console.print(table)
    print_notice(console)


class GelOrder(NamedTuple):
    """What to press on a virtual gel sensor."""

    ball_mm: float
    ball_kpa: float | None
    force_n: float
    presses: int
    calibration_presses: int
    seed: int


CALIBRATION_BALL_MM = 6.0


def _gel_frames(name: str, order: GelOrder, out: Path, *, as_json: bool) -> None:
    import numpy as np

    folder = tsis.report.free_folder(out)
    rng = np.random.default_rng(order.seed)
    with waiting("pressing a gel at finite strain"):
        virtual = tsis.virtual.VirtualGelSensor(tsis.catalog.load_sensor(name), rng=rng)
        ball = virtual.rigid_ball(order.ball_mm / 2)
        if order.ball_kpa is not None:
            ball = tsis.model.SoftSphere(radius_mm=order.ball_mm / 2, young_kpa=order.ball_kpa)
        forces = [order.force_n * (number + 1) / order.presses for number in range(order.presses)]
        made = {f"press-{number}": press for number, press in enumerate(virtual.presses(ball, forces_n=forces), 1)}
        if order.calibration_presses:
            known = virtual.calibration_presses(order.calibration_presses, ball_radius_mm=CALIBRATION_BALL_MM / 2)
            made |= {f"ball-{number}": press for number, press in enumerate(known, 1)}
    thickness = round(virtual.gel.thickness_mm / CALIPER_MM) * CALIPER_MM
    gauge = {
        stem: float(press.force_n or 0.0) * (1.0 + GAUGE_SD * rng.standard_normal()) for stem, press in made.items()
    }
    files = {"untouched.png": tsis.files.encode_picture(virtual.reference)}
    for stem, press in made.items():
        files[f"{stem}.png"] = tsis.files.encode_picture(press.frame)
        sidecar = {
            "format": "tsis-gel-press", "version": 1, "sensor": name,
            "force": {"force_n": gauge[stem], "force_sd_n": GAUGE_SD * gauge[stem]},
        }  # fmt: skip
        files[f"{stem}.json"] = plain_json_bytes(sidecar)
    document = tsis.report.envelope(
        "simulate gel", sensor=name, seed=order.seed, ball_mm=order.ball_mm,
        calibration_ball_mm=CALIBRATION_BALL_MM, thickness_by_caliper_mm=round(thickness, 3),
        frames=[{"frame": f"{stem}.png", "force_n": force} for stem, force in gauge.items()],
    )  # fmt: skip
    written = tsis.report.write_folder(folder, {**files, RESULT: result_bytes(document)})
    tsis.report.write_folder(written / "truth", _truth(virtual, made, ball.young_kpa))
    if as_json:
        print_json({**document, "folder": str(written)})
        return
    table = Table("frame", "force by the gauge / N", title=f"Presses on a virtual {name}")
    for stem, force in gauge.items():
        table.add_row(f"{stem}.png", f"{force:.3f}")
    notes = [
        f"The gel is {thickness:.1f} mm thick by the caliper.",
        f"ball-N: a rigid ball of {CALIBRATION_BALL_MM:g} mm; press-N: the ball of {order.ball_mm:g} mm.",
        "The truth lies apart, in truth/: gel, ball, contacts and depth maps.",
    ]
    print_tables([table], notes, where=f"Frames: {written}")


def _truth(virtual: VirtualGelSensor, made: dict[str, RenderedPress], ball_kpa: float) -> dict[str, bytes]:
    """Files of the truth: gel, ball, contacts, and the depth map of each press."""
    contacts = [
        {"frame": f"{stem}.png", "force_n": press.force_n, "centre_px": list(press.centre_px),
         "radius_px": press.radius_px, "deepest_mm": float(press.depth_mm.max())}
        for stem, press in made.items()
    ]  # fmt: skip
    values = {"gel": asdict(virtual.gel), "ball_kpa": ball_kpa, "contacts": contacts}
    depths = {f"{stem}-depth.npy": npy_bytes(press.depth_mm.astype("float32")) for stem, press in made.items()}
    return {"truth.json": plain_json_bytes(values), **depths}
