"""``tsis calibrate``: the steps of a calibration, one after another, and the file at the end."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.console import Console

from tsis.calibration.force.loading import TIPS_MM
from tsis.calibration.session import LiveBench, SessionFolder, SessionSetup
from tsis.calibration.session.result import DAYS
from tsis.cli.acquire.chosen_camera import VIRTUAL, live_connector, wanted_settings
from tsis.cli.calibrate.beginning import begin
from tsis.cli.calibrate.make import OUT, Days, Out
from tsis.cli.calibrate.operator import Operator
from tsis.cli.calibrate.outcome import made
from tsis.cli.console_output import publish
from tsis.cli.force_gauge import GaugeBaud, GaugeLatency, GaugePort, GaugeSends, GaugeUnit, gauge_log
from tsis.cli.targets import AsJson
from tsis.instrument.acquisition import Acquisition
from tsis.instrument.gauge.connecting import BAUD
from tsis.model import load_probe
from tsis.model.check import LARGEST_SEED, require_number
from tsis.model.errors import InputError
from tsis.virtual.calibration_bench import VirtualBench, bench_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from tsis.calibration.session import CalibrationFrame, CalibrationStep


def guide(
    *,
    camera: Annotated[str, typer.Option(help="virtual, or SOURCE:ID as tsis acquire --list shows it.")] = VIRTUAL,
    mode: Annotated[str | None, typer.Option(help="Mode as tsis acquire --modes shows it.")] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="A camera setting, e.g. exposure_ms=10; repeatable.")
    ] = None,
    gauge: GaugePort = None,
    gauge_unit: GaugeUnit = None,
    gauge_baud: GaugeBaud = BAUD,
    gauge_sends: GaugeSends = False,
    gauge_latency_ms: GaugeLatency = 0.0,
    gauge_share: Annotated[
        float, typer.Option(help="Relative uncertainty of the gauge, from its certificate.")
    ] = 0.001,
    probe: Annotated[
        str, typer.Option(help="Design of the probe, as the catalog names it; estimates need it.")
    ] = "tsis-direct",
    name: Annotated[str, typer.Option(help="What the calibration will be called.")] = "bench",
    pitch_mm: Annotated[float, typer.Option(help="Pitch of the dot board, millimetres.")] = 2.5,
    pitch_sd_mm: Annotated[float, typer.Option(help="Its standard uncertainty.")] = 0.0,
    tip_mm: Annotated[
        list[float] | None,
        typer.Option(help="Radius of a tip of the loading machine; repeatable.", show_default="2, 10, 14"),
    ] = None,
    repeats: Annotated[int, typer.Option(help="Loadings of each tip.", min=1, max=20)] = 1,
    patch_px: Annotated[
        str | None, typer.Option(help="Where the lamps are seen past the probe: left,top,right,bottom in pixels.")
    ] = None,
    session: Annotated[
        Path, typer.Option(help="Folder for the frames; with the same options a session in it goes on.")
    ] = Path("tsis-calibration-frames"),
    seed: Annotated[int, typer.Option(help="Seed of the virtual bench.", min=0, max=LARGEST_SEED)] = 4,
    days: Days = DAYS,
    out: Out = OUT,
    as_json: AsJson = False,
) -> None:
    """Take the frames of every step, and make the calibration file.

    Frames are kept as they come, a folder a step: whatever interrupts the session, it goes on with the step that was
    not finished. Without --camera the virtual bench does every step by itself.
    """
    require_number("--days", days, 1, 3650)
    folder, console = SessionFolder(session), Console(stderr=True, highlight=False)
    terms = SessionSetup(
        name=name,
        probe=probe,
        camera=camera,
        pitch_mm=pitch_mm,
        pitch_sd_mm=pitch_sd_mm,
        gauge_share=gauge_share,
        patch_px=None if patch_px is None else _box(patch_px),
        tips_mm=tuple(tip_mm or TIPS_MM),
        repeats=repeats,
    )
    if camera == VIRTUAL:
        if gauge or gauge_unit or gauge_sends or mode or setting or patch_px:
            raise InputError("--gauge, --mode, --set and --patch-px need --camera; the virtual bench has its own")
        bench = VirtualBench(load_probe(probe), rng=np.random.default_rng(seed), pitch_mm=pitch_mm)
        begin(folder, replace(terms, camera=bench_name(seed), patch_px=bench.patch_px), console)
        console.print("The virtual bench does every step by itself; a person would be told:")
        _take_steps(folder, bench.shots, console)
    else:
        make = live_connector(camera)
        acquisition = Acquisition(make, mode=mode, settings=wanted_settings(make, None, setting or ()))
        with (
            gauge_log(gauge, unit=gauge_unit, baud=gauge_baud, sends=gauge_sends, latency_ms=gauge_latency_ms) as log,
            acquisition,
        ):
            settings = {one.name: one.value for one in acquisition.settings()}
            began = datetime.now(UTC).replace(microsecond=0)
            begin(folder, replace(terms, camera=acquisition.name, settings=settings, began=began), console)
            _take_steps(folder, Operator(LiveBench(acquisition, log), console, has_gauge=log is not None).take, console)
    publish(made(folder, days=days), out, as_json=as_json)


def _take_steps(
    folder: SessionFolder, take: Callable[[CalibrationStep], Iterable[CalibrationFrame] | None], console: Console
) -> None:
    """Take the frames of every step that is not done."""
    steps = folder.plan()
    for number, step in enumerate(steps, start=1):
        console.print(f"{number} of {len(steps)}, {step.name}: {step.instruction}", markup=False, soft_wrap=True)
        if folder.done(step):
            console.print("   done before")
            continue
        shots = take(step)
        if shots is None:
            console.print("   left out")
            continue
        try:
            kept = folder.keep(step, shots)
        except KeyboardInterrupt:
            told = f"The steps before are kept in {folder.path}; the same command goes on with {step.name}."
            console.print(told, markup=False, soft_wrap=True)
            raise
        console.print(f"   {kept} frames")


def _box(text: str) -> tuple[int, int, int, int]:
    try:
        left, top, right, bottom = (int(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"--patch-px must be left,top,right,bottom in pixels; got {text!r:.60}") from error
    return left, top, right, bottom
