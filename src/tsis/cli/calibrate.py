"""``tsis calibrate``: create, show and seal a probe's calibration."""

from __future__ import annotations

import os
import queue
import sys
import threading
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

import tsis
from tsis.__about__ import CALIBRATION_FILE, LARGEST_SEED, VALID_DAYS
from tsis.cli.acquire import (
    VIRTUAL,
    GaugeBaud,
    GaugeLatency,
    GaugePort,
    GaugeSends,
    GaugeUnit,
    gauge_log,
    live_connector,
    requested_settings,
)
from tsis.cli.commands import DefaultCommand
from tsis.cli.options import AsJson
from tsis.cli.output import CommandOutcome, print_json, publish
from tsis.cli.progress import progress_bar, stop_interrupted
from tsis.errors import CalibrationError, InputError
from tsis.present.page import Table
from tsis.present.terminal import people, print_notice, print_tables

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from tsis.calibration.session import CalibrationFrame, CalibrationStep, LiveCalibration, SessionFolder, SessionSetup


def make_outcome(session: SessionFolder, *, days: float) -> CommandOutcome:
    """Compute the calibration of a session."""
    with progress_bar("reading the frames") as advance:
        stored, findings = tsis.calibration.session.calibrate(session, days=days, progress=advance)
    provenance = {
        "session": str(session.path),
        "terms": tsis.files.json_values.to_json_value(session.setup()),
        "sha256": tsis.calibration.file.calibration_sha256(stored),
    }
    return CommandOutcome(
        document=tsis.present.calibration.calibration_document(stored, findings, provenance=provenance),
        page=tsis.present.calibration.calibration_page(stored, findings, provenance=provenance),
        files={CALIBRATION_FILE: tsis.calibration.file.calibration_bytes(stored)},
    )


Days = Annotated[float, typer.Option(help="Days until it expires.")]
Out = Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")]
OUT = Path("tsis-calibration")


def make(
    session: Annotated[Path, typer.Argument(help="Folder of a session, with the frames of each step.")],
    *,
    days: Days = VALID_DAYS,
    out: Out = OUT,
    as_json: AsJson = False,
) -> None:
    """Compute the calibration file from the frames of a session."""
    publish(make_outcome(tsis.calibration.session.SessionFolder(session), days=days), out, as_json=as_json)


SHEET = ("quantity", "measured", "fingertip", "printed")


def show(
    calibration: Annotated[Path, typer.Argument(help="Calibration file.")],
    *,
    as_json: AsJson = False,
) -> None:
    """Show a calibration file; a file changed since it was written is refused."""
    stored = tsis.calibration.file.read_calibration(calibration)
    try:
        stored.require_usable(datetime.now(UTC))
        refusal = ""
    except CalibrationError as error:
        refusal = str(error)
    sheet = tsis.present.calibration.specification_rows(stored)
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "calibrate show",
                sha256=tsis.calibration.file.calibration_sha256(stored),
                usable=not refusal,
                refusal=refusal,
                values=tsis.present.calibration.measured_values(stored),
                specification=[dict(zip(SHEET, row, strict=True)) for row in sheet],
            )
        )
        return
    notes = (*tsis.present.calibration.specification_notes(stored), refusal or "It may be used today.")
    print_tables(tsis.present.calibration.content_tables(stored), notes)


def seal(
    values: Annotated[Path, typer.Argument(help="JSON file with name, probe, response and further values.")],
    *,
    days: Days = VALID_DAYS,
    out: Annotated[Path, typer.Option(help="Calibration file to write; it must not exist.")] = Path(CALIBRATION_FILE),
    as_json: AsJson = False,
) -> None:
    """Check values written by hand, and write them as a calibration file with date, expiry and hash."""
    tsis.model.require.require_number("--days", days, 1, 3650)
    handwritten_calibration = tsis.calibration.file.read_handwritten_calibration(values, days)
    cited = tsis.calibration.file.write_calibration(handwritten_calibration, out)
    if as_json:
        print_json(tsis.present.document.envelope("calibrate seal", file=str(out.resolve()), sha256=cited))
        return
    console = people()
    console.print(f"Calibration: {out.resolve()}", markup=False, soft_wrap=True)
    console.print(f"Good until {handwritten_calibration.expires:%Y-%m-%d}; cited as {cited[:12]}")
    print_notice(console)


class Operator:
    """Takes a step's frames when the operator is ready.

    Parameters
    ----------
    bench
        Camera, and gauge where there is one.
    console
        Where to print; responses come from standard input.
    has_gauge
        Whether a gauge reads the forces; else the operator types them.
    """

    def __init__(self, bench: LiveCalibration, console: Console, *, has_gauge: bool) -> None:
        self._rig, self._console, self._has_gauge = bench, console, has_gauge

    def take(self, step: CalibrationStep) -> Iterator[CalibrationFrame] | None:
        """The step's frames; None when the operator skips it."""
        hint = "Enter when ready" + (", s to leave it out: " if step.optional else ": ")
        response = self._ask(f"   {hint}").strip().lower()
        if step.optional and response == "s":
            return None
        if not step.is_loading:
            return self._rig.still(step.frames)
        return self._by_gauge() if self._has_gauge else self._by_hand()

    def _by_gauge(self) -> Iterator[CalibrationFrame]:
        """A frame every half second with its force, until Enter."""
        responses: queue.SimpleQueue[InputError | None] = queue.SimpleQueue()

        def wait() -> None:
            try:
                self._ask("   load now, slowly; Enter when it is back at 0: ")
            except InputError as error:
                responses.put(error)
            else:
                responses.put(None)

        def over() -> bool:
            if responses.empty():
                return False
            if (error := responses.get()) is not None:
                raise error
            return True

        threading.Thread(target=wait, name="waiting for Enter", daemon=True).start()
        return self._rig.loading(over)

    def _by_hand(self) -> Iterator[CalibrationFrame]:
        """A frame for each typed force."""
        while True:
            text = self._ask("   force in N on the gauge (begin with 0, untouched; an empty line ends): ").strip()
            if not text:
                return
            try:
                yield self._rig.take_frame(float(text.replace(",", ".")))
            except ValueError as error:
                self._console.print(
                    f"   {error if isinstance(error, InputError) else 'that is no number'}", markup=False
                )

    def _ask(self, question: str) -> str:
        self._console.print(question, end="", markup=False, soft_wrap=True)
        line = _line()
        if not line:
            raise InputError("the guide needs responses on standard input, which has ended; run it in a terminal")
        return line


def _line() -> str:
    """The next line of standard input; empty when there are no more.

    Read past Python's buffer: a thread that waits in it for Enter would block the exit after an error.
    """
    if sys.stdin is None:  # closed by the parent process
        return ""
    try:
        source = sys.stdin.fileno()
    except OSError:  # a text stream without a file
        return sys.stdin.readline()
    line = bytearray()
    while not line.endswith(b"\n") and (byte := os.read(source, 1)):
        line += byte
    return line.decode(errors="replace")


OPTIONS = {  # by the setting
    "name": "--name",
    "pitch_mm": "--pitch-mm",
    "pitch_sd_mm": "--pitch-sd-mm",
    "gauge_share": "--gauge-uncertainty",
    "patch_px": "--patch-px",
    "tips_mm": "--tip-mm",
    "repeats": "--repeats",
    "pads_kpa": "--pad-kpa",
    "pad_sd": "--pad-uncertainty",
}


def begin(folder: SessionFolder, terms: SessionSetup, console: Console) -> None:
    """Begin a session, or resume the session in the folder.

    Raises
    ------
    CalibrationError
        When the session began with other settings.
    """
    if not folder.begun:
        folder.begin(terms)
        return
    stored = folder.setup()
    if (stored.probe, stored.camera) != (terms.probe, terms.camera):
        raise CalibrationError(
            f"the session in {tsis.files.reading.printable_path(folder.path)} "
            f"must be of probe {terms.probe!r} and camera "
            f"{terms.camera!r}; it is "
            f"of {stored.probe!r} and {stored.camera!r} (choose another --session)"
        )
    if other := stored.differing(terms):
        raise CalibrationError(
            f"the session in {tsis.files.reading.printable_path(folder.path)} "
            f"began with {_settings_text(stored, other)}; "
            f"this command gives "
            f"{_settings_text(terms, other)} (give the options of its begin, or choose another --session)"
        )
    if changed := stored.changed_setting(terms.settings):
        setting, value, now = changed
        raise CalibrationError(
            f"the session in {tsis.files.reading.printable_path(folder.path)} "
            f"began at {setting} = {value:g}; the camera "
            f"is at {now:g} "
            f"(--set {setting}={value:g}, or choose another --session)"
        )
    console.print(f"Resuming the session in {folder.path} with its settings.", markup=False, soft_wrap=True)


def _settings_text(terms: SessionSetup, names: Iterable[str]) -> str:
    """Settings as options of the command line."""
    return " ".join(_typed(OPTIONS[name], getattr(terms, name)) for name in names)


def _typed(option: str, value: object) -> str:
    if value is None:
        return f"no {option}"
    if option == "--patch-px" and isinstance(value, tuple):
        return f"{option} {','.join(map(str, value))}"
    item = value if isinstance(value, tuple) else (value,)
    return " ".join(f"{option} {item!r}" if isinstance(item, str) else f"{option} {item:.12g}" for item in item)


def guide(
    *,
    camera: Annotated[str, typer.Option(help="virtual, or SOURCE:ID as tsis acquire --list shows it.")] = VIRTUAL,
    mode: Annotated[str | None, typer.Option(help="Mode as tsis acquire --modes shows it.")] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="A camera setting, e.g. exposure_ms=10; repeatable.")
    ] = None,
    gauge: GaugePort = None,
    gauge_unit: GaugeUnit = None,
    gauge_baud: GaugeBaud = None,
    gauge_sends: GaugeSends = False,
    gauge_latency_ms: GaugeLatency = 0.0,
    gauge_uncertainty: Annotated[
        float, typer.Option(help="Relative uncertainty of the gauge, from its certificate.")
    ] = 0.001,
    probe: Annotated[
        str, typer.Option(help="Design of the probe, as the catalog names it; estimates need it.")
    ] = "tsis-direct",
    name: Annotated[str, typer.Option(help="Name of the calibration.")] = "bench",
    pitch_mm: Annotated[float, typer.Option(help="Pitch of the dot board, millimetres.")] = 2.5,
    pitch_sd_mm: Annotated[float, typer.Option(help="Its standard uncertainty.")] = 0.0,
    tip_mm: Annotated[
        list[float] | None,
        typer.Option(help="Radius of a tip of the loading machine; repeatable.", show_default="2, 10, 14"),
    ] = None,
    repeats: Annotated[int, typer.Option(help="Loadings of each tip.", min=1, max=20)] = 1,
    pad_kpa: Annotated[
        list[float] | None,
        typer.Option(help="Modulus of a soft flat pad that measures the light on dents; repeatable, best 5 and 10."),
    ] = None,
    pad_uncertainty: Annotated[float, typer.Option(help="Relative uncertainty of the pads' moduli.")] = 0.05,
    patch_px: Annotated[
        str | None,
        typer.Option(help="Region where the camera sees the lamps past the probe: left,top,right,bottom in pixels."),
    ] = None,
    session: Annotated[
        Path, typer.Option(help="Folder for the frames; the same options resume a session in it.")
    ] = Path("tsis-calibration-frames"),
    seed: Annotated[int, typer.Option(help="Seed of the virtual rig.", min=0, max=LARGEST_SEED)] = 4,
    days: Days = VALID_DAYS,
    out: Out = OUT,
    as_json: AsJson = False,
) -> None:
    """Take the frames of every step, and write the calibration file.

    Frames are saved as they arrive, one folder per step: an interrupted session resumes with its first
    unfinished step. Without --camera the virtual rig does every step.
    """
    import numpy as np

    tsis.model.require.require_number("--days", days, 1, 3650)
    folder, console = tsis.calibration.session.SessionFolder(session), Console(stderr=True, highlight=False)
    terms = tsis.calibration.session.SessionSetup(
        name=name,
        probe=probe,
        camera=camera,
        pitch_mm=pitch_mm,
        pitch_sd_mm=pitch_sd_mm,
        gauge_share=gauge_uncertainty,
        patch_px=None if patch_px is None else _box(patch_px),
        tips_mm=tuple(tip_mm or tsis.calibration.force_line.TIPS_MM),
        repeats=repeats,
        pads_kpa=tuple(pad_kpa or ()),
        pad_sd=pad_uncertainty,
    )
    if camera == VIRTUAL:
        if gauge or gauge_unit or gauge_baud or gauge_sends or gauge_latency_ms or mode or setting or patch_px:
            raise InputError("--gauge, --mode, --set and --patch-px need --camera; the virtual rig has its own")
        rig = tsis.virtual.calibration_bench.VirtualBench(
            tsis.catalog.load_probe(probe), rng=np.random.default_rng(seed), pitch_mm=pitch_mm
        )
        begin(
            folder,
            replace(terms, camera=tsis.virtual.calibration_bench.bench_name(seed), patch_px=rig.patch_px),
            console,
        )
        console.print("The virtual rig does every step; the instructions for an operator are:")
        _take_steps(folder, rig.shots, console)
    else:
        make = live_connector(camera)
        acquisition = tsis.instrument.acquisition.Acquisition(
            make, mode=mode, settings=requested_settings(make, None, setting or ())
        )
        with (
            gauge_log(gauge, unit=gauge_unit, baud=gauge_baud, sends=gauge_sends, latency_ms=gauge_latency_ms) as log,
            acquisition,
        ):
            settings = {setting.name: setting.value for setting in acquisition.settings()}
            began = datetime.now(UTC).replace(microsecond=0)
            begin(folder, replace(terms, camera=acquisition.name, settings=settings, began=began), console)
            _take_steps(
                folder,
                Operator(
                    tsis.calibration.session.LiveCalibration(acquisition, log), console, has_gauge=log is not None
                ).take,
                console,
            )
    publish(make_outcome(folder, days=days), out, as_json=as_json)


def _take_steps(
    folder: SessionFolder, take: Callable[[CalibrationStep], Iterable[CalibrationFrame] | None], console: Console
) -> None:
    """Take the frames of every unfinished step."""
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
            saved = folder.save(step, shots)
        except KeyboardInterrupt:
            stop_interrupted(
                f". The steps before are saved in {folder.path}; the same command resumes with {step.name}."
            )
        console.print(f"   {saved} frames")


def _box(text: str) -> tuple[int, int, int, int]:
    try:
        left, top, right, bottom = (int(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"--patch-px must be left,top,right,bottom in pixels; got {text!r:.60}") from error
    return left, top, right, bottom


def light(
    session: Annotated[Path, typer.Argument(help="Folder of a session with pads (tsis calibrate --pad-kpa 5).")],
    *,
    as_json: AsJson = False,
) -> None:
    """Show what a dent does to the light, fitted with the gain to a session's pads and tips."""
    folder = tsis.calibration.session.SessionFolder(session)
    if not any(step.pad_kpa is not None and folder.done(step) for step in folder.plan()):
        raise CalibrationError(
            f"the session in {tsis.files.reading.printable_path(folder.path)} "
            f"must hold presses on soft flat pads; it holds "
            "none (tsis calibrate --pad-kpa 5 --pad-kpa 10)"
        )
    with progress_bar("reading the frames") as advance:
        stored, findings = tsis.calibration.session.calibrate(folder, progress=advance)
    dents = findings.dents
    assert dents is not None  # of every session with pads
    line = stored.force_line
    ratio = None if line is None else line.soft_ratio
    rows = tsis.present.calibration.light_rows(dents)
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "calibrate light",
                gain_ratio=dents.gain_ratio,
                gain_sd=dents.gain_sd,
                product_sd=dents.product_sd,
                displacement_mm=dents.displacement_mm,
                presses=dents.presses,
                misfit=dents.misfit,
                force_ratio=None if ratio is None else {"value": ratio.value, "sd": ratio.sd},
                tissue=dents.response.provenance(),
            )
        )
        return
    if ratio is not None:
        rows = (*rows, ("force by the line of the tips over that on pads", f"{ratio.value:.3f}", f"sd {ratio.sd:.3f}"))
    columns = ("quantity", "value", "uncertainty")
    print_tables((Table(title=f"Light on dents, {stored.name}", columns=columns, values=rows),))


app = typer.Typer(
    name="calibrate",
    cls=DefaultCommand.named("guide"),
    epilog="Example: tsis calibrate --camera aravis: --gauge /dev/ttyUSB0 --probe tsis-2011 --name bench-2",
)
app.command("guide", epilog="Example: tsis calibrate guide --seed 3 --tip-mm 2 --tip-mm 10 --pad-kpa 5 --out first")(
    guide
)
app.command("make", epilog="Example: tsis calibrate make tsis-calibration-frames --days 90")(make)
app.command("light", epilog="Example: tsis calibrate light tsis-calibration-frames")(light)
app.command("show", epilog="Example: tsis calibrate show tsis-calibration/calibration.json")(show)
app.command("seal", epilog="Example: tsis calibrate seal values.json --out calibration.json")(seal)
