"""``tsis simulate --sensor``: frames of a virtual gel sensor, with forces beside them and the truth apart."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import tsis
from tsis.cli._output import RESULT, npy_bytes, plain_json_bytes, print_json, result_bytes
from tsis.cli._progress import waiting
from tsis.present.page import Column, Table
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from pathlib import Path

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
