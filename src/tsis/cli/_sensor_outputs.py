"""What ``tsis sensor`` puts out: a sensor as a table and a document, and rendered frames of one."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import RESULT, print_json, result_bytes
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from tsis.model import GelSensor


def frames(
    sensor: Annotated[str, typer.Argument(help="Name or file of the sensor.")],
    *,
    presses: Annotated[int, typer.Option(help="Number of presses.")] = 4,
    ball_mm: Annotated[float, typer.Option(help="Diameter of the ball in mm.")] = 6.0,
    seed: Annotated[int, typer.Option(help="Seed of lamps, places, depths and noise.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("gel-frames"),
    as_json: AsJson = False,
) -> None:
    """Render frames of a sensor pressed by a ball, with their truth, to try the commands without a sensor."""
    loaded = tsis.catalog.load_sensor(sensor)
    tsis.model.require_integer("--presses", presses, 1, 100)
    tsis.model.require_number("--ball-mm", ball_mm, 1.0, 40.0, hint="millimetres")
    made = tsis.virtual.gel_frames.rendered_series(loaded, presses, ball_radius_mm=ball_mm / 2, seed=seed)
    files = {"untouched.png": tsis.files.encode_picture(made[0].reference)}
    truth = []
    for number, press in enumerate(made, start=1):
        files[f"press-{number}.png"] = tsis.files.encode_picture(press.frame)
        truth.append({"frame": f"press-{number}.png", "centre_px": list(press.centre_px), "radius_px": press.radius_px})
    document = tsis.present.document.envelope(
        "sensor frames", sensor=loaded.name, ball_mm=ball_mm, seed=seed, truth=truth
    )
    folder = tsis.files.write_folder(tsis.files.free_folder(out), {**files, RESULT: result_bytes(document)})
    if as_json:
        print_json({**document, "folder": str(folder)})
        return
    print_tables([], [f"{presses} presses of a ball of {ball_mm:g} mm, rendered"], where=f"Frames: {folder}")


def sensor_document(sensor: GelSensor) -> dict[str, Any]:
    """The sensor as a part of a JSON result."""
    document = {name: getattr(sensor, name) for name in sensor.__slots__}
    for name in ("thickness_mm", "young_kpa", "poisson"):
        document[name] = asdict(document[name])
    return document | {"layers": [asdict(layer) for layer in sensor.layers], "sources": dict(sensor.sources)}


def sensor_table(sensor: GelSensor) -> Table:
    table = Table("quantity", "value", title=escape(sensor.name))
    face = f"{sensor.width_mm:g} x {sensor.height_mm:g} mm, {sensor.shape}, {sensor.outline}"
    table.add_row("face", face + ("" if sensor.face_radius_mm is None else f" of radius {sensor.face_radius_mm:g} mm"))
    table.add_row("gel thickness / mm", str(sensor.thickness_mm))
    table.add_row("Young's modulus / kPa", str(sensor.young_kpa))
    table.add_row("Poisson's ratio", str(sensor.poisson))
    table.add_row("frame / px", f"{sensor.image_px[0]} x {sensor.image_px[1]}")
    scale = sensor.mm_per_pixel
    shown = "to be calibrated" if scale is None else f"{scale[0]:.4g} x {scale[1]:.4g}"
    table.add_row("mm per pixel", shown + ("" if scale is None else f", sd {sensor.scale_uncertainty:.1%}"))
    table.add_row("light", f"{sensor.light}; a deeper press is {sensor.pressed}")
    table.add_row("markers", "none" if sensor.marker_pitch_mm is None else f"every {sensor.marker_pitch_mm:g} mm")
    return table


def sensor_notes(sensor: GelSensor) -> list[str]:
    """What is unknown and what is not valid."""
    notes = list(sensor.limits)
    if sensor.mm_per_pixel is None:
        notes.append("mm_per_pixel is unknown: results are in pixels until the file has it.")
    for name in ("thickness_mm", "young_kpa", "poisson"):
        bounded = getattr(sensor, name)
        if not bounded.exact and not sensor.layers:
            notes.append(f"{name} is known from {bounded.low:g} to {bounded.high:g}: measure it for narrower results.")
    return notes
