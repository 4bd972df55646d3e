"""Camera: which camera, what the virtual one presses, the calibration and the gauge, as scripts read them."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import pytest
from tests.console.pages.simulated import at_console
from tests.instrument.sending_gauge import sending

from tsis.calibration.file import ProbeCalibration, write_calibration

if TYPE_CHECKING:
    from pathlib import Path

    from tests.console.pages.simulated import Operator
    from tests.console.services.lit_camera import World

    from tsis.console.services.instrument import Instrument

MADE = datetime.now(UTC).replace(microsecond=0) - timedelta(days=1)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A calibration of ten days, of which one is over."""
    file = tmp_path / "monday.json"
    calibration = ProbeCalibration(
        name="of a Monday", probe="tsis-direct", made=MADE, expires=MADE + timedelta(days=10)
    )
    write_calibration(calibration, file)
    return file


def test_a_calibration_is_used_and_given_up(lit: Instrument, file: Path) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("Without one presses are saved, but nothing can be estimated from them.")
        await operator.uploads("Calibration file", file.name, file.read_bytes())
        await operator.hears("The calibration of a Monday is active.")
        identity = (await operator.requested("/state"))["calibration_identity"]
        await operator.sees(f"{identity[:12]}, made {MADE:%Y-%m-%d %H:%M:%S} UTC", "(8 days left)")
        await operator.clicks("Deactivate")
        await operator.misses("of a Monday")
        assert (await operator.requested("/state"))["calibration"] == ""

    at_console(lit, script, "/camera")


@pytest.mark.parametrize(
    ("damage", "message"),
    [("changed", "its content does not match its hash"), ("cut", "JSON"), ("empty", "JSON"), ("other", "calibration")],
)
def test_a_file_that_is_no_calibration_is_refused(lit: Instrument, file: Path, damage: str, message: str) -> None:
    content = file.read_bytes()
    damaged = {
        "changed": content.replace(b"of a Monday", b"of a Sunday", 1),
        "cut": content[: len(content) // 2],
        "empty": b"",
        "other": b'{"format": "something else"}',
    }[damage]

    async def script(operator: Operator) -> None:
        await operator.uploads("Calibration file", file.name, damaged)
        await operator.hears(message)
        assert (await operator.requested("/state"))["calibration"] == ""

    at_console(lit, script, "/camera")


def test_the_virtual_probe_takes_the_place_of_a_camera_and_wrong_numbers_do_not(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("aravis:lit", "stopped", "Forces are typed, or not known.")
        await operator.chooses("Pressed object", "size-8")
        for field, typed, message in (
            ("Depth", "deep", "Depth must be a number, as 2 or 0.5 (you entered 'deep')."),
            ("Depth", "1000", "Depth must be 0"),
            ("Seed", "1.5", "Seed must be a whole number (you entered 1.5)."),
            ("Seed", "-1", "Seed must be 0–"),
        ):
            before = operator.field(field)
            await operator.types(field, typed)
            await operator.clicks("Use the virtual probe")
            await operator.beside(field, message)
            await operator.types(field, before)
        assert (await operator.requested("/state"))["camera"]["choice"]["spec"] == "aravis:lit"
        await operator.types("Depth", "6")
        await operator.types("Seed", "11")
        await operator.clicks("Use the virtual probe")
        await operator.sees("Apply", "runs at ", "the virtual probe")
        choice = (await operator.requested("/state"))["camera"]["choice"]
        assert (choice["spec"], choice["phantom"], choice["depth_mm"], choice["seed"]) == ("virtual", "size-8", 6.0, 11)
        await operator.misses("Force gauge")

    at_console(lit, script, "/camera")


def test_a_sphere_has_no_inclusion_to_change(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("Inclusion other than the catalog's:")
        await operator.chooses("Pressed object", "cl2000x (sphere, for hardness)")
        await operator.misses("Inclusion other than the catalog's:")

    at_console(lit, script, "/camera")


def test_a_camera_that_can_not_be_opened_says_why(lit: Instrument, world: World) -> None:
    world.refuses = "the camera is in use by another program (close it)"

    async def script(operator: Operator) -> None:
        await operator.clicks("Start")
        await operator.hears("the camera is in use by another program (close it)")
        await operator.sees("stopped")
        world.refuses = ""
        await operator.clicks("Start")
        await operator.sees("runs at ", "64 x 48 pixels")
        assert operator.field("Mode") == "Mono8-64x48@100"

    at_console(lit, script, "/camera")


def test_a_gauge_that_is_not_there_says_why(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("Force gauge")
        await operator.types("Bits per second", "fast")
        await operator.clicks("Connect")
        await operator.beside("Bits per second", "Baud must be a number, as 2 or 0.5 (you entered 'fast').")
        await operator.types("Bits per second", "5")
        await operator.clicks("Connect")
        await operator.beside("Bits per second", "Baud must be 50–")

    at_console(lit, script, "/camera")


def test_forces_come_from_a_gauge_until_it_is_given_up(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.clicks("Start")
        await operator.types("Serial port", port, enter=False)
        await operator.clicks("Sends continuously (do not query it)")
        await operator.clicks("Connect")
        await operator.sees("Forces are read from the ")
        assert f"Forces are read from the {(await operator.requested('/state'))['gauge']}." in operator.texts
        while (force := (await operator.requested("/sight"))["sight"]["force"]) is None:
            await operator.pause()
        assert (force["value_n"], force["source"]) == (0.5, "gauge")
        await operator.clicks("Use no gauge")
        await operator.sees("Forces are typed, or not known.")

    with sending(b"500 mN\r\n") as port:
        at_console(lit, script, "/camera")
