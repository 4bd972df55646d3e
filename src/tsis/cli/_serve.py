"""``tsis serve``: the virtual probe as a GigE Vision camera on the network."""

from __future__ import annotations

import signal
from typing import Annotated

import typer

import tsis
from tsis.__about__ import LARGEST_SEED
from tsis.cli._groups import ended_by
from tsis.cli._options import DepthMm, DiameterMm, ForceN, PhantomName, ProbeName, YoungKpa
from tsis.cli._output import people, print_notice
from tsis.cli._progress import waiting
from tsis.errors import CameraError

SLOWEST = 0.1  # frames/s: allows the longest exposure of the simulated camera
POLL_S = 0.5


def serve(
    *,
    phantom: PhantomName = "hardness-100",
    probe: ProbeName = "tsis-2011",
    force_n: ForceN = 1.0,
    diameter_mm: DiameterMm = None,
    depth_mm: DepthMm = None,
    young_kpa: YoungKpa = None,
    interface: Annotated[str, typer.Option(help="Address of this machine to listen on.")] = "127.0.0.1",
    serial: Annotated[str, typer.Option(help="Serial number of the camera.")] = "TSIS01",
    frames_per_s: Annotated[float, typer.Option(help="Frames a second until a program sets another rate.")] = 30.0,
    seed: Annotated[int, typer.Option(help="Seed of every random error.", min=0, max=LARGEST_SEED)] = 4,
) -> None:
    """Serve the virtual probe's frames as a GigE Vision camera, until Ctrl-C.

    Any GigE Vision program can read it; its exposure and gain change the image.
    """
    import numpy as np

    rng = np.random.default_rng(seed)
    target = tsis.catalog.phantom_variant(phantom, diameter_mm, depth_mm, young_kpa)
    with waiting("tracing the light of the lamps"):
        rig = tsis.virtual.VirtualProbe(tsis.catalog.load_probe(probe), rng=rng, strain="small")  # a live view
    camera = tsis.virtual.VirtualCamera(rig, target, rng=rng, force_n=force_n, frames_per_s=SLOWEST)
    server = tsis.virtual.GigEServer(camera, interface=interface, serial=serial, frames_per_s=frames_per_s)
    console = people()
    with ended_by(signal.SIGINT, signal.SIGTERM) as ended, server:
        serving = f"Serving {camera.name} at {force_n:g} N as {server.identity} on {interface}; Ctrl-C ends it."
        console.print(serving, markup=False, soft_wrap=True)
        console.print("List it with: tsis acquire --list", markup=False)
        console.print(f"Read it with: tsis acquire --camera aravis:{server.identity}", markup=False, soft_wrap=True)
        print_notice(console)
        console.file.flush()
        while server.failure is None and not ended.wait(POLL_S):
            pass
    if server.failure is not None:
        raise CameraError(f"serving ended: {server.failure}") from server.failure
    console.print(f"Ended; {server.sent} frames were sent.")
