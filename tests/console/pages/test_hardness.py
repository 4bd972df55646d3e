"""Hardness: the next step follows from what is there, and the modulus shown is the stored one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui
from tests.console.pages.simulated import at_console
from tests.console.services.instruments import ANN
from tests.records.pressed_object import pressed, stored_object

from tsis.calibration.file import write_calibration
from tsis.calibration.frames import parse_usable_calibration
from tsis.console.services.choice import CameraChoice

if TYPE_CHECKING:
    from pathlib import Path

    from tests.console.pages.simulated import Operator

    from tsis.console.services.instrument import Instrument


def test_without_camera_or_calibration_it_says_what_to_do_first(lit: Instrument, tmp_path: Path) -> None:
    file = tmp_path / "bench.json"
    write_calibration(pressed()[1], file)

    async def script(operator: Operator) -> None:
        await operator.sees("Next: start the camera, on the page Examine; it is stopped.", "The camera is stopped.")
        assert not operator.enabled("Estimate")
        lit.start(by=lit.control.owner().identity)  # type: ignore[union-attr]
        await operator.sees("Next: activate a calibration, on the page Camera; there is none")
        lit.use_calibration(
            parse_usable_calibration(file.read_bytes(), file.name),
            by=lit.control.owner().identity,  # type: ignore[union-attr]
        )
        await operator.misses("there is none")
        await operator.sees("None yet; 2 at different forces are best.")

    at_console(lit, script, "/hardness")


def test_a_stored_hardness_is_shown_and_estimated_again_with_the_typed_radius(lit: Instrument) -> None:
    lit.control.take(ANN, "Ann")
    lit.set_target(stored_object(lit.store).number, by=ANN)
    lit.control.release(ANN)

    async def script(operator: Operator) -> None:
        await operator.sees("Done. Press again at another force to test it", "Object, 0.7 N", "Object, 1.2 N")
        (before,) = (await operator.requested("/targets/1/estimates"))["estimates"]
        await operator.sees("Hardness of target 1, cl2000x", f"{before['parameters']['young_kpa']['mean']:.0f} kPa")
        await operator.until(lambda: operator.field("Radius of the object") == "3.000", "the radius is not there")
        for radius, sd, message in (
            ("round", "0.02", "Radius of the object must be a number, as 2 or 0.5 (you entered 'round')."),
            ("", "0.02", "Radius of the object must be given with its standard deviation (nothing was entered)."),
            ("300", "0.02", "Radius of the object must be 1–50 mm (you entered 300)."),
            ("3", "1", "Its standard uncertainty must be 0–0.3 mm, up to a tenth of the radius (you entered 1)."),
            ("3", "wide", "Its standard uncertainty must be a number, as 2 or 0.5 (you entered 'wide')."),
        ):
            await operator.types("Radius of the object", radius)
            await operator.types("Its standard uncertainty", sd)
            await operator.clicks("Estimate", ui.button)
            await operator.beside(message.partition(" must")[0], message)
        await operator.types("Radius of the object", "3.2")
        await operator.types("Its standard uncertainty", "0.02")
        await operator.clicks("Estimate", ui.button)
        while len(found := (await operator.requested("/targets/1/estimates"))["estimates"]) == 1:
            await operator.pause()
        after = found[-1]
        assert after["options"] == {"radius_mm": 3.2, "radius_sd_mm": 0.02}
        assert after["parameters"]["young_kpa"]["mean"] != before["parameters"]["young_kpa"]["mean"]
        await operator.sees(f"{after['parameters']['young_kpa']['mean']:.0f} kPa")

    at_console(lit, script, "/hardness")


def test_another_object_gets_a_number_of_its_own(lit: Instrument) -> None:
    stored_object(lit.store)

    async def script(operator: Operator) -> None:
        await operator.sees("target 1", "Object, 0.7 N")
        await operator.clicks("Another object")
        await operator.sees("target 2")
        await operator.misses("Object, 0.7 N")
        assert (await operator.requested("/state"))["target"] == 2

    at_console(lit, script, "/hardness")


def test_the_virtual_probe_has_no_object_until_one_lies_under_it(lit: Instrument) -> None:
    lit.control.take(ANN, "Ann")
    lit.choose(CameraChoice(), by=ANN)
    lit.control.release(ANN)

    async def script(operator: Operator) -> None:
        await operator.sees("Next: place an object under the virtual probe.", "Virtual sphere")
        assert not operator.enabled("Estimate")
        assert operator.named("Press and save") == []

    at_console(lit, script, "/hardness")
