"""``tsis sensor frames``: rendered frames of a gel sensor, to try the commands without one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import RESULT, print_json, print_tables, result_bytes


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
    made = tsis.virtual.rendered_series(loaded, presses, ball_radius_mm=ball_mm / 2, seed=seed)
    files = {"untouched.png": tsis.files.encode_picture(made[0].reference)}
    truth = []
    for number, press in enumerate(made, start=1):
        files[f"press-{number}.png"] = tsis.files.encode_picture(press.frame)
        truth.append({"frame": f"press-{number}.png", "centre_px": list(press.centre_px), "radius_px": press.radius_px})
    document = tsis.report.envelope("sensor frames", sensor=loaded.name, ball_mm=ball_mm, seed=seed, truth=truth)
    folder = tsis.report.write_folder(tsis.report.free_folder(out), {**files, RESULT: result_bytes(document)})
    if as_json:
        print_json({**document, "folder": str(folder)})
        return
    print_tables([], [f"{presses} presses of a ball of {ball_mm:g} mm, rendered"], where=f"Frames: {folder}")
