"""``tsis simulate``: a press, gel frames, or a virtual scan."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
import typer

import tsis
from tsis.cli.options import (
    AsJson,
    DepthMm,
    DiameterMm,
    ForceN,
    PhantomName,
    ProbeOption,
    YoungKpa,
    chosen_probe,
    typed_options,
)
from tsis.cli.output import RESULT, npy_bytes, plain_json_bytes, print_json, result_bytes
from tsis.cli.progress import waiting
from tsis.errors import InputError
from tsis.present.page import Column, Table
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.model.press import PressField
    from tsis.model.probe import Probe
    from tsis.virtual.gel_frames import RenderedPress
    from tsis.virtual.gel_sensor import VirtualGelSensor


GAUGE_SD, CALIPER_MM = 0.01, 0.1  # relative error of a force gauge; step of a caliper


class GelOrder(NamedTuple):
    """What to press on a virtual gel sensor."""

    ball_mm: float
    ball_kpa: float | None
    force_n: float
    presses: int
    calibration_presses: int
    seed: int
    drag: float

    def check(self) -> None:
        """Refuse values out of range; `InputError`."""
        if self.ball_kpa is not None:
            tsis.model.require.require_number("--ball-kpa", self.ball_kpa, 1.0, 1e5, hint="kilopascals")
        tsis.model.require.require_number("--ball-mm", self.ball_mm, 1.0, 40.0, hint="millimetres")
        tsis.model.require.require_number("--force-n", self.force_n, 0.01, 50.0, hint="newtons")
        tsis.model.require.require_number("--drag", self.drag, -2.0, 2.0)
        tsis.model.require.require_integer("--presses", self.presses, 1, 20)
        tsis.model.require.require_integer("--calibration-presses", self.calibration_presses, 0, 60)


CALIBRATION_BALL_MM = 6.0


def write_gel_frames(name: str, order: GelOrder, out: Path, *, as_json: bool) -> None:
    """Press balls on a virtual exemplar of a sensor, write the folder, and print what is in it."""
    order.check()
    folder = tsis.files.result_folder.free_folder(out)
    rng = np.random.default_rng(order.seed)
    with waiting("pressing a gel at finite strain"):
        virtual = tsis.virtual.gel_sensor.VirtualGelSensor(tsis.catalog.load_sensor(name), rng=rng)
        ball = virtual.rigid_ball(order.ball_mm / 2)
        if order.ball_kpa is not None:
            ball = tsis.model.phantom.SoftSphere(radius_mm=order.ball_mm / 2, young_kpa=order.ball_kpa)
        forces = [order.force_n * (number + 1) / order.presses for number in range(order.presses)]
        dragged = virtual.presses(ball, forces_n=forces, shear=(order.drag, 0.0))
        made = {f"press-{number}": press for number, press in enumerate(dragged, 1)}
        if order.calibration_presses:
            known = virtual.calibration_presses(order.calibration_presses, ball_radius_mm=CALIBRATION_BALL_MM / 2)
            made |= {f"ball-{number}": press for number, press in enumerate(known, 1)}
    thickness = round(virtual.gel.thickness_mm / CALIPER_MM) * CALIPER_MM
    gauge = {
        stem: float(press.force_n or 0.0) * (1.0 + GAUGE_SD * rng.standard_normal()) for stem, press in made.items()
    }
    files = {"untouched.png": tsis.files.images.encode_picture(virtual.reference)}
    for stem, press in made.items():
        files[f"{stem}.png"] = tsis.files.images.encode_picture(press.frame)
        sidecar = {
            "format": "tsis-gel-press", "version": 1, "sensor": name,
            "force": {"force_n": gauge[stem], "force_sd_n": GAUGE_SD * gauge[stem]},
        }  # fmt: skip
        files[f"{stem}.json"] = plain_json_bytes(sidecar)
    document = tsis.present.document.envelope(
        "simulate gel", sensor=name, seed=order.seed, ball_mm=order.ball_mm,
        calibration_ball_mm=CALIBRATION_BALL_MM, thickness_by_caliper_mm=round(thickness, 3),
        frames=[{"frame": f"{stem}.png", "force_n": force} for stem, force in gauge.items()],
    )  # fmt: skip
    written = tsis.files.result_folder.write_folder(folder, {**files, RESULT: result_bytes(document)})
    tsis.files.result_folder.write_folder(written / "truth", _truth(virtual, made, ball.young_kpa))
    if as_json:
        print_json({**document, "folder": str(written)})
        return
    table = Table(
        title=f"Presses on a virtual {name}",
        columns=("frame", Column(label="force by the gauge", unit="N", form=".3f")),
        values=tuple((f"{stem}.png", force) for stem, force in gauge.items()),
    )
    notes = [
        f"The gel is {thickness:.1f} mm thick by the caliper.",
        f"ball-N: a rigid ball of {CALIBRATION_BALL_MM:g} mm; press-N: the ball of {order.ball_mm:g} mm.",
        "The truth lies apart, in truth/: gel, ball, contacts and depth maps.",
    ]
    print_tables([table], notes, where=f"Frames: {written}")


def _truth(virtual: VirtualGelSensor, made: dict[str, RenderedPress], ball_kpa: float) -> dict[str, bytes]:
    """Files of the truth: gel, ball, contacts, and the depth map of each press."""
    contacts = [
        {"frame": f"{stem}.png", "force_n": press.force_n, "shear_n": list(press.shear_n),
         "centre_px": list(press.centre_px), "radius_px": press.radius_px, "deepest_mm": float(press.depth_mm.max())}
        for stem, press in made.items()
    ]  # fmt: skip
    values = {"gel": asdict(virtual.gel), "ball_kpa": ball_kpa, "contacts": contacts}
    depths = {f"{stem}-depth.npy": npy_bytes(press.depth_mm.astype("float32")) for stem, press in made.items()}
    return {"truth.json": plain_json_bytes(values), **depths}


SHOWN_RADII = 13
GEL = "Frames of a virtual gel sensor (--sensor)"
SCAN = "Presses of a virtual scan (--scan)"


def _lumps(given: list[str] | None) -> list[tsis.virtual.scan.VirtualLump]:
    """The lumps of --lump, or three."""
    if not given:
        return list(tsis.virtual.scan.THREE_LUMPS)
    names = ("x_mm", "y_mm", "depth_mm", "diameter_mm", "young_kpa")
    lumps = []
    for text in given:
        try:
            values = dict(zip(names, map(float, text.split(",")), strict=True))
        except ValueError as error:
            raise InputError(f"--lump must be five numbers, X,Y,DEPTH,DIAMETER,KPA; got {text!r}") from error
        lumps.append(tsis.virtual.scan.VirtualLump(**values))
    return lumps


BESIDE_MM = 10.0


def _require_under(lumps: list[tsis.virtual.scan.VirtualLump], places_mm: NDArray[np.float64]) -> None:
    """Refuse lumps that no press is near, and lumps that overlap."""
    low, high = places_mm.min(axis=0), places_mm.max(axis=0)
    for number, lump in enumerate(lumps, 1):
        place = np.array([lump.x_mm, lump.y_mm])
        beside = float(np.hypot(*np.maximum(np.maximum(low - place, place - high), 0.0)))
        most = lump.diameter_mm / 2 + BESIDE_MM
        if beside > most:
            raise InputError(
                f"--lump {number} must lie at most {most:g} mm, its radius and {BESIDE_MM:g} mm, beside the presses, "
                f"which end at ({high[0]:g}, {high[1]:g}) mm; got {beside:.3g} mm (move it, or press at more --places)"
            )
        for earlier, other in enumerate(lumps[: number - 1], 1):
            apart, needed = _apart_mm(lump, other), (lump.diameter_mm + other.diameter_mm) / 2
            if apart < needed:
                raise InputError(
                    f"--lump {earlier} and --lump {number} must not overlap: their centres must be {needed:g} mm apart "
                    f"or more; got {apart:.3g} mm (move one)"
                )


def _apart_mm(one: tsis.virtual.scan.VirtualLump, other: tsis.virtual.scan.VirtualLump) -> float:
    depth = one.depth_mm + one.diameter_mm / 2 - other.depth_mm - other.diameter_mm / 2
    return float(np.linalg.norm([one.x_mm - other.x_mm, one.y_mm - other.y_mm, depth]))


def write_scan(
    probe: Probe,
    lumps: list[tsis.virtual.scan.VirtualLump],
    places_mm: NDArray[np.float64],
    out: Path,
    seed: int,
    force_n: float,
    place_sd_mm: float,
    *,
    as_json: bool,
) -> None:
    """Write the folder of a virtual scan, with the truth apart."""
    from numpy.random import default_rng

    with waiting(f"pressing at {len(places_mm)} places"):
        made = tsis.virtual.scan.virtual_scan(
            probe, lumps, places_mm, rng=default_rng(seed), force_n=force_n, place_sd_mm=place_sd_mm
        )
    truth = {"lumps": [asdict(each) for each in lumps], "seed": seed, "place_sd_mm": place_sd_mm}
    files = {
        **tsis.mapping.scan_folder.scan_files(made, probe=probe.name),
        "truth.json": plain_json_bytes(truth),
    }
    folder = tsis.files.result_folder.write_folder(tsis.files.result_folder.free_folder(out), files)
    if as_json:
        print_json(tsis.present.document.envelope("simulate", "scan", **truth, folder=str(folder)))
        return
    units = {"x": "mm", "y": "mm", "depth of the top": "mm", "diameter": "mm", "modulus": "kPa"}
    table = Table(
        title=f"{len(places_mm)} presses of {probe.name} over these lumps",
        columns=tuple(Column(label=label, unit=unit) for label, unit in units.items()),
        values=tuple(tuple(asdict(each).values()) for each in lumps),
    )
    print_tables([table], ["The kernel of tsis map made these presses: they do not judge it."], where=f"Scan: {folder}")


# Options of each mode by the names of the function; --json belongs to all.
MODES = {
    "--list": ("show_catalog",),
    "--scan": ("scan", "probe", "force_n", "lump", "places", "spacing_mm", "place_sd_mm", "seed"),
    "--sensor": ("sensor", "force_n", "ball_mm", "ball_kpa", "presses", "calibration_presses", "drag", "seed", "out"),
    "": ("phantom", "probe", "force_n", "diameter_mm", "depth_mm", "young_kpa", "strain"),
}
WORDS = {
    "--list": "the catalog (--list)",
    "--scan": "a scan (--scan)",
    "--sensor": "a gel sensor (--sensor)",
    "": "a press on a phantom",
}


def _require_own(context: typer.Context, mode: str) -> None:
    """Refuse options of other modes."""
    others = {name: None for names in MODES.values() for name in names if name not in MODES[mode]}
    for name in others:
        for option in typed_options(context, (name,)):
            fitting = " or ".join(WORDS[other] for other in MODES if name in MODES[other])
            raise InputError(
                f"{option} must be given for {fitting} only; {mode or WORDS['']} does not use it (leave it out)"
            )


class Strain(StrEnum):
    """The strain model."""

    SMALL = "small"
    FINITE = "finite"


def simulate(
    context: typer.Context,
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
    scan: Annotated[
        Path | None, typer.Option(help="Folder of a virtual scan over lumps, for tsis map.", rich_help_panel=SCAN)
    ] = None,
    lump: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y,DEPTH,DIAMETER,KPA",
            help="A lump under the scan, in mm and kPa; the depth is that of its top. Repeat it for several.",
            rich_help_panel=SCAN,
            show_default="three lumps",
        ),
    ] = None,
    places: Annotated[int, typer.Option(help="Presses along x and along y.", min=2, max=30, rich_help_panel=SCAN)] = 5,
    spacing_mm: Annotated[float, typer.Option(help="Distance of the presses.", rich_help_panel=SCAN)] = 10.0,
    place_sd_mm: Annotated[float, typer.Option(help="Standard deviation of each place.", rich_help_panel=SCAN)] = 0.3,
    as_json: AsJson = False,
) -> None:
    """Press a probe on a phantom, or with --sensor balls on a gel sensor, by finite elements.

    With --scan, press it at many places over lumps, by the kernel that tsis map uses.
    """
    mode = "--list" if show_catalog else "--scan" if scan is not None else "--sensor" if sensor is not None else ""
    _require_own(context, mode)
    if show_catalog:
        _catalog(as_json=as_json)
        return
    if scan is not None:
        grid, lumps = tsis.virtual.scan.grid_places(places, spacing_mm), _lumps(lump)
        _require_under(lumps, grid)
        write_scan(chosen_probe(probe), lumps, grid, scan, seed, force_n, place_sd_mm, as_json=as_json)
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
