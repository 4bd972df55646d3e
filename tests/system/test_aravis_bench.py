"""A real camera protocol behind the bench: settings, a press that is kept, a camera that is killed and comes back."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, TypeVar

import cv2
import numpy as np
import pytest
from tests.console.services.instruments import ANN
from tests.system.aravis_peer import LOOPBACK, fake_camera, loopback_camera_port, served_probe
from tests.waiting import until

from tsis.console.services.choice import InstrumentSettings
from tsis.console.services.instrument import Instrument
from tsis.errors import CameraError, InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

pytestmark = pytest.mark.system
T = TypeVar("T")
CAMERA = f"aravis:{LOOPBACK}"


@pytest.fixture
def _port() -> Iterator[None]:
    with loopback_camera_port():
        yield


@pytest.fixture
def bench(_port: None, tmp_path: Path) -> Iterator[Instrument]:
    terms = InstrumentSettings(camera=CAMERA, workspace=tmp_path / "workspace", store=tmp_path / "store")
    with Instrument(terms) as made:
        made.control.take(ANN, "Ann", held_s=600.0)
        yield made


def done(act: Callable[[], T]) -> T:
    """What ``act`` returns once the camera is there; on a busy machine it can be silent and count as lost."""
    result: list[T] = []

    def tried() -> bool:
        with suppress(CameraError):
            result.append(act())
        return bool(result)

    until(tried)
    return result[0]


def test_a_camera_is_set_killed_and_comes_back_and_what_was_kept_stays(bench: Instrument) -> None:
    with pytest.raises(CameraError):
        bench.start(by=ANN)  # nothing is plugged in
    assert not bench.state().camera.running
    with fake_camera("B1") as process:
        done(lambda: bench.start(by=ANN))
        done(lambda: bench.adjust("exposure_ms", 7.0, by=ANN))
        with pytest.raises(InputError, match="exposure_ms must lie in"):
            done(lambda: bench.adjust("exposure_ms", -1.0, by=ANN))
        first = done(lambda: bench.snapshot(by=ANN))
        assert first.press.settings["exposure_ms"] == 7.0
        levels = cv2.imread(str(first.files.raw), cv2.IMREAD_UNCHANGED)
        assert levels is not None
        np.testing.assert_array_equal(bench.store.levels(first.press.frame), levels)
        state = bench.state()
        assert (state.camera.rows, state.camera.columns) == levels.shape
        until(lambda: {each.name: each.value for each in bench.state().camera.settings}.get("exposure_ms") == 7.0)
        before = bench.state().camera.interruptions
        process.kill()
        until(lambda: bench.state().camera.lost)
        assert bench.state().trouble[0].startswith("The camera is away")
        with pytest.raises(CameraError, match="is away; nothing was saved"):
            bench.snapshot(by=ANN)
    with fake_camera("B1"):
        second = done(lambda: bench.snapshot(by=ANN))
        assert second.press.settings["exposure_ms"] == 7.0  # made again
        assert bench.state().camera.interruptions > before
        until(lambda: bench.state().trouble == ())
    assert [press.id for press in bench.store.presses(first.target)] == [first.press.id, second.press.id]


def test_the_served_probe_is_seen_and_its_press_kept(bench: Instrument) -> None:
    with served_probe("B2", "--seed", "4"):
        done(lambda: bench.start(by=ANN))
        bench.hold(role="target", force_n=1.0, by=ANN)
        kept = done(lambda: bench.snapshot(by=ANN))
        assert kept.press.force_n == 1.0
        assert bench.store.levels(kept.press.frame).shape == (492, 768)
        until(lambda: bench.frame_analysis is not None and bench.frame_analysis.contact is not None)
        dim = bench.store.levels(kept.press.frame).mean()
        done(lambda: bench.adjust("exposure_ms", 5.0, by=ANN))
        darker = bench.store.levels(done(lambda: bench.snapshot(by=ANN)).press.frame).mean()
        # 8 is the black level; a quarter of the light is left, and no frame of before the change is kept.
        assert (darker - 8.0) / (dim - 8.0) == pytest.approx(0.25, rel=0.02)
