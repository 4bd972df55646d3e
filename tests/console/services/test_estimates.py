"""Estimates from saved presses: the presses they use, and the same result by another path."""

from __future__ import annotations

import json
import sys
import threading
from contextlib import closing
from dataclasses import asdict, replace
from datetime import timedelta
from functools import partial
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from tests.console.services.instruments import ANN, virtual_instrument
from tests.hardness.stand_ins import by_table
from tests.records.sample import WHEN, sample_record
from tests.waiting import HANGS_S

import tsis
import tsis.hardness
from tsis.console.services import instrument as estimates_module
from tsis.console.services.choice import BALL_MM, CameraChoice
from tsis.console.services.instrument import estimate_target, newest_presses, warm_up
from tsis.console.services.memory import LIGHT_N, TissueReading, read_tissue
from tsis.console.serving import warm_up_once
from tsis.console.worker import WorkerProcess
from tsis.errors import ControlError, InputError
from tsis.imaging.sensor import Sensor
from tsis.inclusion import InclusionPrior
from tsis.virtual.direct_contact import DirectContactRig

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from tsis.console.services.captures import SavedPress
    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import Job
    from tsis.records.values import StoredPress, TargetRecord

SAMPLE = sample_record()
FIRST = SAMPLE.presses[0]


def press(name: str, role: str, force_n: float | None, **changes: Any) -> StoredPress:
    return replace(FIRST, id=name.ljust(32, "0"), role=role, force_n=force_n, **changes)


def taken(*presses: StoredPress) -> list[str]:
    """Which presses an estimate takes, those given in the order in which they were taken."""
    ordered = tuple(replace(item, taken=WHEN + timedelta(hours=i)) for i, item in enumerate(presses))
    record: TargetRecord = replace(SAMPLE, presses=ordered)
    return [item.id.rstrip("0") for item in newest_presses(record, "inclusion")]


def test_of_each_role_and_force_the_newest_whatever_the_sitting() -> None:
    assert taken(
        press("a", "target", 0.7),
        press("b", "plain", 1.1),
        press("c", "target", 1.1),
        press("d", "target", 0.7),  # another sitting
        press("e", "plain", 1.1),
    ) == ["c", "d", "e"]


def test_only_those_of_the_probe_and_the_calibration_of_the_newest_on_the_target() -> None:
    other = "f" * 64
    assert taken(
        press("a", "target", 0.7),
        press("b", "plain", 0.7),
        press("c", "target", 1.1, calibration=other),
        press("d", "plain", 1.1, calibration=other),
        press("e", "target", 1.3, calibration=other, probe="tsis-domed"),
    ) == ["e"]
    assert taken(press("a", "target", 0.7), press("b", "plain", 1.1, calibration=other)) == ["a"]


def test_presses_without_a_force_are_all_taken_and_those_that_no_estimate_takes_are_not() -> None:
    assert taken(
        press("a", "target", None), press("b", "target", None), press("c", "untouched", 0.0), press("d", "ball", 1.0)
    ) == ["a", "b"]
    assert taken(press("a", "plain", 1.1)) == []


def test_presses_at_no_force_are_left_out_and_say_nothing_of_the_terms() -> None:
    assert taken(
        press("a", "target", 0.7),
        press("b", "plain", 0.0),
        press("c", "plain", 1.1),
        press("d", "target", 0.0, calibration="f" * 64),
    ) == ["a", "c"]
    assert taken(press("a", "target", 0.0)) == []
    assert taken() == []


@pytest.fixture(scope="module")
def probe(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Instrument]:
    with virtual_instrument(tmp_path_factory.mktemp("estimates")) as instrument:
        yield instrument


def pressed(instrument: Instrument, holds: Sequence[tuple[str, float]]) -> list[SavedPress]:
    remaining = []
    for role, force_n in holds:
        instrument.hold(role=role, force_n=force_n, by=ANN)
        remaining.append(instrument.snapshot(by=ANN))
    return remaining


def failed(job: Job) -> str:
    assert job.wait(HANGS_S)
    assert job.state().status == "failed"
    return job.state().sentence


def test_what_cannot_be_estimated_is_said(probe: Instrument) -> None:
    probe.start(by=ANN)
    probe.set_target(40, by=ANN)
    with pytest.raises(InputError, match="target"):
        probe.estimate(40)
    (plain,) = pressed(probe, [("plain", 1.0)])
    assert "target 40 must have a press on the target" in failed(probe.estimate(40))
    assert "none is one" in failed(probe.estimate(40, presses=[plain.press.id]))
    assert "'nobody' is none" in failed(probe.estimate(40, presses=["nobody"]))
    probe.adjust("gain", 3.0, by=ANN)
    pressed(probe, [("target", 1.0)])
    assert "must have been taken under a calibration" in failed(probe.estimate(40))
    probe.preset("default", by=ANN)
    (calibration_with,) = pressed(probe, [("target", 1.0)])
    everything = [item.id for item in probe.store.presses(calibration_with.target)]
    assert "these are of several" in failed(probe.estimate(40, presses=everything))
    refused: tuple[dict[str, Any], ...] = (
        {"kind": "depth"},
        {"presses": []},
        {"presses": [3]},
        {"options": {"prior": {"diameter_mm": [5.0, 1.0]}}},
    )
    for wrong in refused:
        with pytest.raises(InputError):
            probe.estimate(40, **wrong)
    for number in (0, 1.5, "1", float("nan")):
        with pytest.raises(InputError, match="target must"):
            probe.estimate(number)  # type: ignore[arg-type]


def raw_image(remaining: SavedPress) -> tsis.TactileImage:
    """The press as its files tell it, without the store."""
    levels = cv2.imread(str(remaining.files.raw), cv2.IMREAD_UNCHANGED)
    assert levels is not None
    reported = json.loads(remaining.files.sidecar.read_text())
    return tsis.TactileImage(
        grey=levels.astype(float), mm_per_pixel=Sensor().mm_per_pixel, force_n=reported["force"]["force_n"]
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 11])
def test_an_estimate_is_that_of_the_frames_and_holds_the_truth(probe: Instrument, seed: int) -> None:
    probe.choose(CameraChoice(probe="tsis-2011", seed=seed), by=ANN)
    probe.start(by=ANN)
    probe.set_target(seed, by=ANN)
    remaining = pressed(probe, [("target", 0.5), ("target", 1.0), ("target", 1.5), ("plain", 1.0)])
    job = probe.estimate(seed)
    assert job.wait(HANGS_S)
    assert job.state().status == "done", job.state().sentence
    stored = job.result
    stage = probe.camera_controller.subject
    assert stage is not None
    directly = tsis.inclusion.estimate(
        [raw_image(item) for item in remaining[:3]],
        probe=tsis.load_probe("tsis-2011"),
        calibration=stage.calibration.response,
        reference=[raw_image(remaining[3])],
        strain="small",
    )
    assert set(stored.presses) == {item.press.id for item in remaining}
    for name, truth in {"diameter_mm": 10.0, "depth_mm": 5.0, "young_kpa": 100.0}.items():
        np.testing.assert_allclose(stored.estimate.samples[name], directly.samples[name], rtol=1e-9)
        low, high = stored.estimate.interval(0.9)[name]
        assert low <= truth <= high, name
    assert probe.store.estimates(remaining[0].target)[-1].id == stored.id


@pytest.mark.slow
def test_hardness_of_a_sphere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The mechanics of the presses come from a table: this test is about the path through the instrument."""
    monkeypatch.setattr("tsis.console.services.choice.DirectContactRig", partial(DirectContactRig, solve=by_table))
    with virtual_instrument(tmp_path, probe="tsis-direct", phantom="cl2003x") as instrument:
        instrument.start(by=ANN)
        remaining = pressed(instrument, [("target", 0.5), ("target", 0.9), ("ball", 0.7)])
        stage = instrument.camera_controller.subject
        assert stage is not None
        radii: dict[str, Any] = {
            "radius_mm": stage.written_radius_mm,
            "radius_sd_mm": 0.03,
            "reference_radius_mm": BALL_MM,
        }
        assert "reference_radius_mm must be given" in failed(instrument.estimate(1, kind="hardness", options={}))
        job = instrument.estimate(1, kind="hardness", options=radii)
        assert job.wait(HANGS_S)
        assert job.state().status == "done", job.state().sentence
        directly = tsis.hardness.estimate(
            [raw_image(item) for item in remaining[:2]],
            probe=tsis.load_probe("tsis-direct"),
            calibration=stage.calibration.response,
            reference=[raw_image(remaining[2])],
            **radii,
        )
        assert job.result.estimate.flags == directly.flags
        results = job.result.estimate.untrusted  # at 0.9 N it clips
        np.testing.assert_allclose(results.samples["young_kpa"], directly.untrusted.samples["young_kpa"], rtol=1e-9)
        low, high = results.interval(0.9)["young_kpa"]
        assert low <= remaining[0].target.truth["young_kpa"] <= high


@pytest.mark.slow
def test_an_estimate_that_is_ended_stores_nothing(probe: Instrument) -> None:
    probe.choose(CameraChoice(probe="tsis-2011"), by=ANN)
    probe.start(by=ANN)
    probe.set_target(77, by=ANN)
    (remaining,) = pressed(probe, [("target", 1.0)])
    job = probe.estimate(77)
    job.end()
    assert job.wait(HANGS_S)
    assert job.state().status == "ended"
    assert probe.store.estimates(remaining.target) == ()


def test_estimates_of_a_probe_are_warmed_up_once(tmp_path: Path) -> None:
    called: list[tuple[str, str]] = []
    over = threading.Event()

    class Recording:
        def call(self, work: Callable[[str], None], probe: str) -> None:
            called.append((work.__name__, probe))
            over.set()
            raise InputError("a probe that nobody knows is no trouble")

    worker: Any = Recording()
    with virtual_instrument(tmp_path) as instrument:
        instrument.before_estimates = warm_up_once(worker)
        for _ in range(2):
            instrument.start(by=ANN)
            instrument.stop(by=ANN)
    assert over.wait(HANGS_S)
    assert called == [("warm_up", "tsis-2011")]


def loaded(names: tuple[str, ...]) -> bool:
    return all(name in sys.modules for name in names)


def test_the_process_of_reports_has_loaded_what_draws_them_before_the_first() -> None:
    with closing(WorkerProcess()) as worker:
        worker.call(warm_up, "tsis-2011")
        assert worker.call(loaded, ("tsis.present.pdf", "matplotlib.backends.backend_agg"))


def test_a_light_press_gives_the_tissue_the_forces_and_the_prior(tmp_path: Path) -> None:
    """The console's reading is that of the files by the same calls that `tsis protocol` makes."""
    with virtual_instrument(tmp_path, probe="tsis-domed") as instrument:
        with pytest.raises(ControlError):
            instrument.read_tissue(by="somebody else")
        instrument.start(by=ANN)
        job = instrument.read_tissue(by=ANN)
        assert job.wait(HANGS_S)
        reading = job.result
        state = instrument.state()
        assert (state.role, state.force_n, state.tissue) == ("plain", LIGHT_N, reading)
        record = instrument.store.record(instrument.store.target(1))
        stage = instrument.camera_controller.subject
        assert stage is not None
        (light,) = record.presses
        directly = tsis.inclusion.tissue.tissue_modulus(
            record.image(light), probe=stage.probe, calibration=stage.calibration.response
        )
        assert reading.young_kpa == pytest.approx(directly.young_kpa)
        assert reading.interval_kpa[0] <= 5.0 <= reading.interval_kpa[1]  # of the phantom
        assert reading.forces_n == tsis.inclusion.tissue.protocol_forces(
            stage.probe, tissue_young_kpa=reading.young_kpa
        )
        assert newest_presses(record, "inclusion", tissue=reading) == ()
        instrument.set_target(2, by=ANN)
        assert instrument.state().tissue is None  # each target has its own
    with virtual_instrument(tmp_path, probe="tsis-domed") as instrument:
        assert instrument.state().tissue == reading  # a restart begins on target 1


def test_an_estimate_is_on_the_tissue_that_was_read(probe: Instrument, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def recording(record: TargetRecord, request: Any, **_: Any) -> None:
        asked.append(request)
        raise InputError("that was enough")

    monkeypatch.setattr(estimates_module, "estimate_stored", recording)
    probe.choose(CameraChoice(probe="tsis-2011"), by=ANN)
    probe.start(by=ANN)
    probe.set_target(61, by=ANN)
    light, reference, target = pressed(probe, [("plain", 0.2), ("plain", 1.0), ("target", 1.0)])
    reading = TissueReading(press=light.press.id, young_kpa=10.0, interval_kpa=(9.0, 11.0), forces_n=(2.0,))
    estimate = partial(estimate_target, probe.store, 61, kind="inclusion", presses=None, progress=lambda *_: None)
    own = {"prior": asdict(InclusionPrior(poisson=0.48))}
    for options, tissue in (({}, None), ({}, reading), (own, reading)):
        with pytest.raises(InputError, match="enough"):
            estimate(options=options, tissue=tissue)
    ids = [{press.id for press in request.presses} for request in asked]
    assert ids == [{light.press.id, reference.press.id, target.press.id}, *[{reference.press.id, target.press.id}] * 2]
    assert "prior" not in asked[0].options
    moved = asked[1].options["prior"]
    assert (moved["tissue_young_kpa"], moved["young_kpa"]) == (10.0, (80.0, 240.0))
    assert asked[2].options["prior"]["poisson"] == 0.48


def test_a_press_that_is_on_no_even_tissue_reads_none(probe: Instrument) -> None:
    probe.choose(CameraChoice(probe="tsis-2011"), by=ANN)
    probe.start(by=ANN)
    probe.set_target(62, by=ANN)
    (edge,) = pressed(probe, [("target", 1.0)])  # a lump is under it
    with pytest.raises(InputError, match="even tissue"):
        read_tissue(probe.store.record(edge.target), edge.press.id)
