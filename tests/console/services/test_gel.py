"""A gel sensor before the camera: its files, and what its frames show."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.console.services.instruments import ANN, BOB, virtual_instrument
from tests.waiting import until

from tsis.catalog.sensors import load_sensor, sensor_toml
from tsis.console.services.choice import CameraChoice
from tsis.errors import CameraError, ControlError, FileInputError, InputError, UnknownNameError
from tsis.files.images import encode_picture
from tsis.imaging.depth import calibrate_depth, depth_calibration_json
from tsis.virtual.camera import GEL_BALL_MM, GEL_PRESS_SETTING, GEL_PRESSES
from tsis.virtual.gel_frames import rendered_series

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.console.services.instrument import Instrument
    from tsis.imaging.depth import GelReading
    from tsis.virtual.gel_frames import RenderedPress

SENSOR, SEED = "gelsight-mini", 1


@cache
def presses() -> list[RenderedPress]:
    """What the virtual sensor shows."""
    return rendered_series(load_sensor(SENSOR), GEL_PRESSES, ball_radius_mm=GEL_BALL_MM / 2, seed=SEED)


@cache
def calibration() -> bytes:
    """The file that tsis depth calibrate writes of some of these presses."""
    frames, reference = [press.frame for press in presses()[:4]], presses()[0].reference
    result = calibrate_depth(frames, sensor=load_sensor(SENSOR), reference=reference, ball_mm=GEL_BALL_MM)
    return depth_calibration_json(result)


@pytest.fixture
def instrument(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Instrument]:
    """An instrument before the virtual gel sensor, which runs untouched."""
    monkeypatch.setattr("tsis.console.services.frames.EVERY_S", 0.01)
    with virtual_instrument(tmp_path) as created:
        created.choose(CameraChoice(spec=f"virtual-gel:{SENSOR}", seed=SEED), by=ANN)
        yield created


def reading(instrument: Instrument) -> GelReading | None:
    analysis = instrument.frame_analysis
    return None if analysis is None else analysis.gel


def ready(instrument: Instrument) -> None:
    """Start, choose the sensor, and take its untouched frame."""
    instrument.start(by=ANN)
    instrument.gel.use_sensor(SENSOR, by=ANN)
    until(lambda: instrument.state().camera.rows > 0)
    instrument.gel.use_reference(by=ANN)
    until(lambda: reading(instrument) is not None)


def test_a_press_is_shown_with_outline_depth_and_force(instrument: Instrument, tmp_path: Path) -> None:
    file = tmp_path / "depth.json"
    file.write_bytes(calibration())  # before the live view, which would analyse frames meanwhile
    ready(instrument)
    untouched = reading(instrument)
    assert untouched is not None
    assert (untouched.good, untouched.reasons, untouched.outline_px) == (False, ("no contact",), ())
    instrument.gel.use_calibration(file, by=ANN)
    instrument.adjust(GEL_PRESS_SETTING, 2, by=ANN)
    truth = presses()[1]
    until(lambda: (shown := reading(instrument)) is not None and shown.good and shown.force_n is not None)
    shown, analysis = reading(instrument), instrument.frame_analysis
    assert shown is not None
    assert analysis is not None
    assert analysis.contact is not None
    assert analysis.contact.centroid_px == pytest.approx(truth.centre_px, abs=2.0)
    outline = np.array(analysis.contact.outline_px) - truth.centre_px
    assert np.hypot(*outline.T) == pytest.approx(truth.radius_px, rel=0.1)
    assert shown.radius_px == pytest.approx(truth.radius_px, rel=0.08)
    assert shown.radius_mm is not None
    assert shown.deepest_mm == pytest.approx(truth.depth_mm.max(), abs=0.1)
    assert shown.force_interval_n is not None
    assert shown.force_n is not None
    assert 0.0 < shown.force_interval_n[0] < shown.force_n < shown.force_interval_n[1]


def test_a_frame_in_grey_is_one_message(instrument: Instrument) -> None:
    """The camera of another sensor, without colours, does not end the live view."""
    ready(instrument)
    received = instrument.camera_controller.fresh()
    with pytest.raises(InputError, match="in colour"):
        instrument.gel.analyse(
            type(received)(frame=type(received.frame)(pixels=received.frame.pixels, sequence=0), arrived_s=0.0), 1, None
        )


def test_files_of_another_kind_are_refused(instrument: Instrument, tmp_path: Path) -> None:
    gel = instrument.gel
    with pytest.raises(InputError, match="gel sensor must be chosen"):
        gel.use_reference(by=ANN)
    with pytest.raises(UnknownNameError, match="gelsight-mini"):
        gel.use_sensor("gelsight-mimi", by=ANN)
    gel.use_sensor(SENSOR, by=ANN)
    with pytest.raises(CameraError, match="start it"):
        gel.use_reference(by=ANN)
    for name, content in (("a.toml", b"[a]\nwidth = 1"), ("b.toml", b"\xff"), ("c.png", b"no picture")):
        file = tmp_path / name
        file.write_bytes(content)
        with pytest.raises((InputError, FileInputError), match=r"must|is called"):
            (gel.use_reference if name.endswith("png") else gel.use_sensor)(file, by=ANN)
    file = tmp_path / "depth.json"
    file.write_bytes(calibration().replace(b'"gelsight-mini"', b'"another"', 1))
    with pytest.raises(InputError, match="must be of gelsight-mini; got one of 'another'"):
        gel.use_calibration(file, by=ANN)
    assert gel.setup.reference is None
    assert gel.setup.calibration is None


def test_a_picture_can_be_the_untouched_frame_and_no_sensor_is_a_probe(instrument: Instrument, tmp_path: Path) -> None:
    file = tmp_path / "untouched.png"
    file.write_bytes(encode_picture(presses()[0].reference))
    instrument.gel.use_sensor(SENSOR, by=ANN)
    instrument.gel.use_reference(file, by=ANN)
    assert instrument.gel.setup.reference is not None
    instrument.start(by=ANN)
    until(lambda: reading(instrument) is not None)
    instrument.gel.use_sensor(None, by=ANN)
    until(lambda: instrument.frame_analysis is not None and instrument.frame_analysis.gel is None)


def test_only_the_owner_of_the_camera_may(instrument: Instrument) -> None:
    with pytest.raises(ControlError, match="controlled by Ann"):
        instrument.gel.use_sensor(SENSOR, by=BOB)
    assert instrument.gel.setup.sensor is None


def test_a_sensor_s_file_does_not_read_the_frame_that_it_names(instrument: Instrument, tmp_path: Path) -> None:
    """An uploaded file may name any path of the console's machine."""
    file = tmp_path / "mine.toml"
    file.write_text(sensor_toml(replace(load_sensor(SENSOR), name="mine", reference_file="../secret.png")))
    instrument.gel.use_sensor(file, by=ANN)
    sensor = instrument.gel.setup.sensor
    assert sensor is not None
    assert (sensor.name, sensor.reference_file) == ("mine", None)
