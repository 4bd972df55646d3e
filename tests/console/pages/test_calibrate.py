"""Calibrate: a session from its terms to the file, with a camera and typed forces and with the virtual rig."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.calibration_force import PROBE, SENSOR
from tests.console.pages.simulated import at_console
from tests.console.services.instruments import ANN, lit_instrument
from tests.console.services.lit_camera import USUAL_GAIN, observed
from tests.waiting import HANGS_S

from tsis.calibration.frames import parse_usable_calibration
from tsis.calibration.session import SessionFolder, SessionSetup
from tsis.virtual.calibration_bench import VirtualBench

if TYPE_CHECKING:
    from pathlib import Path

    from tests.console.pages.simulated import Operator

    from tsis.console.services.instrument import Instrument

WRONG = (
    ("Name", " ", "Name must be given"),
    ("Pitch of the dot board", "-1", "Pitch of the dot board must be 0.05–50 mm (you entered −1)."),
    ("Pitch of the dot board", "wide", "Pitch of the dot board must be a number, as 2 or 0.5 (you"),
    ("Its standard uncertainty", "nan", "Its standard uncertainty must be a number"),
    ("Radii of the tips", "2, 2", "Radii of the tips must hold each tip once"),
    ("Radii of the tips", "2, 1e9", "Radii of the tips must be 0.1–1000 mm (you entered 1e+09)."),
    ("Radii of the tips", "14", "A calibration needs at least 2 loadings, of two tips or of one twice"),
    ("Loadings of each tip", "1.5", "Loadings of each tip must be a whole number"),
    ("Relative uncertainty of the gauge", "3", "Relative uncertainty of the gauge must be 0–0.5"),
    ("Lamps seen past the probe", "4, 4, 36", "Lamps seen past the probe must be left, top, right, bottom in pixels"),
    ("Lamps seen past the probe", "4, 4, 36, -1", "Lamps seen past the probe must be 0–100000 (you entered −1)."),
)


def test_wrong_terms_begin_no_session(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("None yet.", "With the chosen camera. Start it first")
        for field, typed, message in WRONG:
            before = operator.field(field)
            await operator.types(field, typed)
            await operator.clicks("Begin")
            await operator.beside(field, message)
            await operator.types(field, before)
        await operator.sees("None yet.")

    at_console(lit, script, "/calibrate")
    assert not (lit.terms.workspace / "calibrations").exists()


def test_a_session_with_a_camera_and_typed_forces(lit: Instrument) -> None:
    lit.control.take(ANN, "Ann")
    lit.start(by=ANN)
    lit.control.release(ANN)

    async def script(operator: Operator) -> None:
        await operator.sees("With aravis:lit, at its present settings.")
        await operator.types("Name", "May <i>left</i>")
        await operator.chooses("Probe", "tsis-direct")
        await operator.types("Radii of the tips", "10, 14")
        await operator.clicks("Begin")
        await operator.sees("May <i>left</i>", ": dark", "Switch the lamps off", "tips of 10, 14 mm")
        await operator.until(lambda: not operator.enabled("Make the calibration"), "it can be made of nothing")
        await operator.clicks("Take 16 frames")
        await operator.sees(": untouched", "1 of ")
        await operator.clicks("Step dark: 16 frames")
        await operator.sees("Done: 16 frames are saved.", "A frame of dark; its mean grey level is ")
        await operator.clicks("Repeat this step")
        await operator.sees("Remove the frames of step 'dark' and take it again?")
        await operator.clicks("Cancel")
        await operator.misses("take it again?")
        await operator.sees("Done: 16 frames are saved.")
        await operator.clicks("Repeat this step")
        await operator.sees("take it again?")
        await operator.clicks("Remove and repeat")
        await operator.sees("Take 16 frames", "Steps: 0 of ")
        (optional, *_) = (name for name in operator.named("Step ") if "open, optional" in name)
        await operator.clicks(optional)
        await operator.sees("Skip this step")
        await operator.clicks("Skip this step")
        await operator.sees("left out")
        await operator.clicks("Step tip-10mm-1: open")
        await operator.sees("No frame yet.")
        for typed, message in (
            ("hard", "Force must be a number, as 2 or 0.5 (you entered 'hard')."),
            ("1e6", "Force must be −"),
        ):
            await operator.types("Force that the gauge shows", typed)
            await operator.beside("Force that the gauge shows", message)
        for typed in ("0", "0,5", "1.0"):
            await operator.types("Force that the gauge shows", typed)
            await operator.until(lambda: operator.field("Force that the gauge shows") == "", "it is not taken")
        await operator.sees("3 frames", "0.5 N", "1 N", "3 forces, not saved")
        await operator.clicks("Remove the last")
        await operator.sees("2 frames")
        await operator.clicks("Back at 0 N: save the loading")
        grey = observed(50, USUAL_GAIN).mean()
        await operator.sees("Done: 2 frames are saved.", f"at 0.50 N; its mean grey level is {grey:.1f}.")
        await operator.clicks("Sessions")
        await operator.sees("May <i>left</i>", "tsis-direct, aravis:lit", "1 of 10 steps")

    at_console(lit, script, "/calibrate")


def all_taken(folder: Path, camera: str) -> SessionFolder:
    """A session with every step done, of a small camera."""
    virtual = VirtualBench(PROBE, rng=np.random.default_rng(8), sensor=SENSOR, pitch_mm=1.5)
    session = SessionFolder(folder)
    session.begin(
        SessionSetup(
            name="all",
            probe=PROBE.name,
            camera=camera,
            began=datetime.now(UTC).replace(microsecond=0),
            pitch_mm=1.5,
            patch_px=virtual.patch_px,
            tips_mm=(10.0, 14.0),
        )
    )
    for step in session.plan():
        session.save(step, virtual.shots(step))
    return session


def test_the_calibration_is_made_shown_activated_and_downloaded(tmp_path: Path) -> None:
    all_taken(tmp_path / "workspace" / "calibrations" / "all", "aravis:lit")

    async def script(operator: Operator) -> None:
        await operator.sees("Every step is done or skipped.")
        await operator.types("Good for", "soon")
        await operator.clicks("Make the calibration")
        await operator.beside("Good for", "Days must be a number, as 2 or 0.5 (you entered 'soon').")
        await operator.types("Good for", "100")
        await operator.clicks("Make the calibration")
        await operator.sees("cited as ")
        await operator.clicks("Download the file")
        content = (await operator.user.download.next(timeout=HANGS_S)).content
        usable = parse_usable_calibration(content, "all.json")
        await operator.sees(f"cited as {usable.identity[:12]}")
        await operator.clicks("Activate")
        await operator.hears("Calibration all is active.")
        await operator.sees("It is active.")
        assert (await operator.requested("/state"))["calibration_identity"] == usable.identity
        made, expires, scale = usable.calibration.made, usable.calibration.expires, usable.calibration.scale
        assert made is not None
        assert expires is not None
        assert scale is not None
        assert (expires - made).days == 100
        await operator.sees("{:.4g} x {:.4g} mm".format(*scale.mm_per_pixel))

    with lit_instrument(tmp_path) as instrument:
        instrument.control.release(ANN)
        at_console(instrument, script, "/calibrate/all")


def test_a_session_that_is_not_there_is_said(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("All sessions")
        await operator.clicks("All sessions")
        await operator.sees("Begin a calibration")

    at_console(lit, script, "/calibrate/nobody")
