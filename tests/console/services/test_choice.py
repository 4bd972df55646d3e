"""What can be chosen, and the virtual probe: its frames and saved presses show role and force."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.console.services.instruments import ANN, virtual_instrument
from tests.waiting import until

from tsis.catalog.phantoms import list_spheres
from tsis.console.services.choice import CameraChoice, InstrumentSettings, VirtualSubject
from tsis.console.worker import WorkerProcess
from tsis.errors import ControlError, InputError, MechanicsError, UnknownNameError
from tsis.records.values import REFERENCE_ROLES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.console.services.instrument import Instrument


@pytest.mark.parametrize("spec", ["files:frames", "files:", "video:press.mkv"])
def test_stored_frames_are_no_camera_and_the_cure_is_named(spec: str) -> None:
    for choose in (lambda: CameraChoice(spec=spec), lambda: InstrumentSettings(camera=spec)):
        with pytest.raises(InputError, match=r"stored \(estimate from stored frames with tsis examine, or enter them"):
            choose()


@pytest.mark.parametrize(
    ("given", "error", "text"),
    [
        ({"spec": "aravs:1"}, UnknownNameError, "did you mean 'aravis'"),
        ({"spec": ""}, UnknownNameError, "camera source"),
        ({"spec": 3}, InputError, "spec must be a str"),
        ({"spec": "virtual:2"}, InputError, "called virtual and nothing more"),
        ({"spec": "aravis:" + "x" * 300}, InputError, "at most 200 characters"),
        ({"spec": "aravis:a\x00b"}, InputError, "that can be shown"),
        ({"spec": "opencv:front"}, InputError, "go by their number, as in opencv:0; got 'opencv:front'"),
        ({"spec": "opencv:-1"}, InputError, "go by their number"),
        ({"spec": "opencv:\u0663"}, InputError, "go by their number"),
        ({"spec": "opencv:" + "9" * 30}, InputError, "go by their number"),
        ({"mode": "Mono8-1x1@1"}, UnknownNameError, "no mode is called 'Mono8-1x1@1'"),
        ({"mode": ""}, UnknownNameError, "no mode is called ''"),
        ({"mode": 3}, InputError, "mode must be a str"),
        ({"probe": "tsis"}, UnknownNameError, "no probe is called"),
        ({"phantom": "nothing"}, UnknownNameError, "no phantom is called"),
        ({"diameter_mm": -1.0}, InputError, "diameter_mm must"),
        ({"depth_mm": float("nan")}, InputError, "depth_mm must"),
        ({"young_kpa": "soft"}, InputError, "young_kpa must"),
        ({"diameter_mm": 60.0}, InputError, "mm"),
        ({"phantom": "cl2000x", "depth_mm": 3.0}, InputError, "cl2000x is a sphere"),
        ({"seed": -1}, InputError, "seed must lie in"),
        ({"seed": 1.5}, InputError, "seed must be a whole number"),
    ],
)
def test_what_cannot_be_chosen_is_refused_before_anything_starts(
    given: dict[str, Any], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        CameraChoice(**given)


def test_what_can_be_pressed_follows_from_the_choice() -> None:
    assert CameraChoice().roles == ("target", "plain", "untouched")
    assert CameraChoice(phantom="cl2000x", probe="tsis-direct").roles == ("target", "ball", "untouched")
    assert CameraChoice(spec="aravis:").roles == ("target", "plain", "untouched", "ball")
    assert (CameraChoice().touch_n, CameraChoice(phantom="cl2003x").touch_n) == (1.0, 0.7)
    assert CameraChoice(spec="opencv:0").touch_n is None


@pytest.mark.parametrize("choice", [CameraChoice(), CameraChoice(phantom="cl2000x", probe="tsis-direct")])
def test_the_mode_of_the_virtual_probe_is_the_one_that_it_has(choice: CameraChoice) -> None:
    (mode,) = VirtualSubject(choice).connect().modes()
    assert replace(choice, mode=mode.label).mode == mode.label


def test_a_real_camera_may_be_chosen_in_a_mode_that_only_it_knows() -> None:
    assert CameraChoice(spec="opencv:", mode="Mono16-64x48@100").mode == "Mono16-64x48@100"


def test_a_console_may_begin_with_a_sphere() -> None:
    terms = InstrumentSettings(phantom="cl2003x", probe="tsis-direct", seed=9)
    assert terms.choice == CameraChoice(phantom="cl2003x", probe="tsis-direct", seed=9)
    with pytest.raises(UnknownNameError, match="kind of store"):
        InstrumentSettings(kind="patient")


USUAL = CameraChoice(probe="tsis-2011")


@pytest.fixture(scope="module")
def shared_probe(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Instrument]:
    with virtual_instrument(tmp_path_factory.mktemp("virtual")) as instrument:
        yield instrument


@pytest.fixture
def probe(shared_probe: Instrument) -> Instrument:
    """The instrument in the same state whatever the test before it did: usual settings, target 1 pressed with 1 N."""
    if shared_probe.camera_controller.choice != USUAL:
        shared_probe.choose(USUAL, by=ANN)
    shared_probe.start(by=ANN)
    shared_probe.preset("default", by=ANN)
    shared_probe.set_target(1, by=ANN)
    if (shared_probe.state().role, shared_probe.state().force_n) != ("target", 1.0):
        shared_probe.hold(role="target", force_n=1.0, by=ANN)
    return shared_probe


def brightness(instrument: Instrument) -> float:
    return float(instrument.camera_controller.fresh().frame.pixels.mean())


def test_role_and_force_are_those_of_the_frames(probe: Instrument) -> None:
    observed = {}
    for role, force_n in (("target", 1.0), ("target", 0.5), ("plain", 1.0), ("untouched", 1.0)):
        probe.hold(role=role, force_n=force_n, by=ANN)
        remaining = probe.snapshot(by=ANN)
        pressed_n = 0.0 if role == "untouched" else force_n
        assert (remaining.press.role, remaining.press.force_n) == (role, pressed_n)
        assert remaining.press.settings["force_n"] == pressed_n
        assert (probe.state().role, probe.state().force_n) == (role, force_n)
        observed[role, force_n] = float(probe.store.levels(remaining.press.frame).mean())
    untouched, plain, soft, hard = (
        observed[item] for item in (("untouched", 1.0), ("plain", 1.0), ("target", 0.5), ("target", 1.0))
    )
    assert untouched == pytest.approx(8.0, abs=0.1)  # the black level
    assert soft < hard
    assert abs(hard - plain) > 0.2  # the inclusion shows


def test_what_is_kept_of_it(probe: Instrument) -> None:
    remaining = probe.snapshot(by=ANN)
    stage = probe.camera_controller.subject
    assert stage is not None
    assert (remaining.target.name, dict(remaining.target.truth)) == (
        "hardness-100",
        {"diameter_mm": 10.0, "depth_mm": 5.0, "young_kpa": 100.0},
    )
    assert (remaining.press.probe, remaining.press.calibration) == ("tsis-2011", stage.calibration.identity)
    assert remaining.press.mm_per_pixel == pytest.approx(stage.mm_per_pixel)
    assert remaining.notes == ()


def test_the_press_stays_over_stop_and_start(probe: Instrument) -> None:
    probe.hold(role="plain", force_n=0.8, by=ANN)
    owned = brightness(probe)
    probe.stop(by=ANN)
    assert (probe.state().role, probe.state().force_n) == ("plain", 0.8)
    probe.start(by=ANN)
    assert brightness(probe) == pytest.approx(owned, abs=0.05)  # the same press, and not another of the same force
    probe.stop(by=ANN)
    probe.hold(role="untouched", by=ANN)
    probe.start(by=ANN)
    assert brightness(probe) == pytest.approx(8.0, abs=0.1)


def test_its_own_calibration_holds_at_its_usual_settings_only(probe: Instrument) -> None:
    probe.adjust("exposure_ms", 10.0, by=ANN)
    assert "holds at exposure_ms = 20; the camera is at 10" in probe.state().trouble[0]
    assert probe.snapshot(by=ANN).press.calibration is None
    probe.preset("default", by=ANN)
    assert probe.state().trouble == ()
    with pytest.raises(InputError, match="no setting is called 'force_n'"):
        probe.adjust("force_n", 2.0, by=ANN)


def test_what_cannot_be_pressed_leaves_the_press_as_it_was(probe: Instrument, monkeypatch: pytest.MonkeyPatch) -> None:
    before = brightness(probe)
    stage = probe.camera_controller.subject
    assert stage is not None

    def too_hard(*_: object, **__: object) -> None:
        raise MechanicsError("the tissue cannot be pressed so hard")

    monkeypatch.setattr("tsis.console.services.choice.light_of", too_hard)
    with pytest.raises(MechanicsError, match="so hard"):
        probe.hold(role="plain", force_n=3.0, by=ANN)
    monkeypatch.undo()
    for wrong in (-1.0, 6.0, float("nan")):
        with pytest.raises(InputError, match="force_n must lie in"):
            probe.hold(force_n=wrong, by=ANN)
    assert (probe.state().role, probe.state().force_n) == ("target", 1.0)
    assert brightness(probe) == pytest.approx(before, abs=0.05)


def test_too_hard_a_press_names_the_largest_force_which_can_be_pressed(
    probe: Instrument, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = probe.camera_controller.subject
    assert stage is not None
    exact = replace(stage._rig.calibration, force_sd=0.0)  # else one press in five at 0.2 N more is still valid
    monkeypatch.setattr(stage._rig, "_calibration", exact)
    with pytest.raises(
        MechanicsError, match=r"a strain of [0-9.]+; .* is valid to 0\.3: choose a force of at most"
    ) as reported:
        probe.hold(role="plain", force_n=4.0, by=ANN)
    message = str(reported.value)
    assert "finite" not in message
    assert "stiffer" not in message
    largest_n = float(message.rpartition("at most ")[2].removesuffix(" N"))
    probe.hold(role="plain", force_n=largest_n, by=ANN)
    with pytest.raises(MechanicsError, match=f"at most {largest_n:g} N$"):
        probe.hold(role="plain", force_n=largest_n + 0.2, by=ANN)
    assert (probe.state().role, probe.state().force_n) == ("plain", largest_n)


def test_the_guard_sees_what_is_held(probe: Instrument) -> None:
    probe.hold(role="untouched", by=ANN)
    until(
        lambda: (
            probe.frame_analysis is not None and any(flag.name == "no-contact" for flag in probe.frame_analysis.flags)
        )
    )
    probe.hold(role="target", by=ANN)
    until(lambda: probe.frame_analysis is not None and probe.frame_analysis.contact is not None)
    analysis = probe.frame_analysis
    assert analysis is not None
    assert analysis.contact is not None
    assert np.hypot(analysis.contact.centroid_px[0] - 383.5, analysis.contact.centroid_px[1] - 245.5) < 40
    assert analysis.force is not None
    assert (analysis.force.value_n, analysis.force.source) == (1.0, "virtual")


def kept_files(instrument: Instrument) -> int:
    return sum(path.is_file() for path in instrument.terms.workspace.rglob("*"))


def test_no_press_of_a_phantom_gets_into_a_store_of_subjects(tmp_path_factory: pytest.TempPathFactory) -> None:
    with virtual_instrument(tmp_path_factory.mktemp("subjects"), kind="subject") as instrument:
        instrument.start(by=ANN)
        with pytest.raises(
            ControlError, match="which a store of subjects does not keep: start the console with --kind"
        ):
            instrument.snapshot(by=ANN)
        assert instrument.store.targets() == ()
        assert kept_files(instrument) == 0


def test_another_phantom_under_the_same_number_is_refused_and_under_another_kept(probe: Instrument) -> None:
    probe.set_target(9, by=ANN)
    remaining = probe.snapshot(by=ANN)
    files = kept_files(probe)
    others = (
        (CameraChoice(probe="tsis-2011", phantom="size-8"), r"on size-8 \("),
        (CameraChoice(probe="tsis-2011", depth_mm=6.0), r"on hardness-100 \(changed\) \(depth_mm 6, "),
        (CameraChoice(probe="tsis-2011", phantom="plain"), r"on plain \(no inclusion\) now: choose another target"),
    )
    for at, (choice, text) in enumerate(others):
        probe.set_target(9, by=ANN)
        probe.choose(choice, by=ANN)
        probe.start(by=ANN)
        with pytest.raises(ControlError, match=r"target 9 is of hardness-100 \(depth_mm 5, .*" + text):
            probe.snapshot(by=ANN)
        assert kept_files(probe) == files
        assert [press.id for press in probe.store.presses(remaining.target)] == [remaining.press.id]
        probe.set_target(20 + at, by=ANN)
        assert probe.snapshot(by=ANN).notes == ()
        files = kept_files(probe)
    probe.choose(USUAL, by=ANN)
    probe.start(by=ANN)
    probe.set_target(9, by=ANN)
    assert probe.snapshot(by=ANN).notes == ()


def test_roles_are_those_that_estimates_take() -> None:
    assert set(REFERENCE_ROLES.values()) <= {*CameraChoice().roles, *CameraChoice(phantom="cl2000x").roles}


def test_the_same_seed_makes_the_same_stage() -> None:
    def first(seed: int) -> np.ndarray:
        stage = VirtualSubject(CameraChoice(probe="tsis-2011", seed=seed))
        stage.hold("target", 1.0)
        camera = stage.connect()
        camera.open()
        camera.start()
        return next(camera.frames()).pixels

    np.testing.assert_array_equal(first(5), first(5))
    assert (first(5) != first(6)).any()


class Elsewhere(WorkerProcess):
    """Calls work on copies, as a process of its own would."""

    def call(self, work: Any, *given: Any, **named: Any) -> Any:
        sent = pickle.loads(pickle.dumps((work, given, named)))
        return pickle.loads(pickle.dumps(sent[0](*sent[1], **sent[2])))


@pytest.mark.parametrize(
    "choice",
    [USUAL, pytest.param(CameraChoice(probe="tsis-direct", phantom=list_spheres()[0]), marks=pytest.mark.slow)],
)
def test_presses_that_are_solved_elsewhere_are_the_same(choice: CameraChoice) -> None:
    here, there = VirtualSubject(choice), VirtualSubject(choice, solver=Elsewhere())
    light: list[Any] = []
    for role, force_n in ((choice.roles[0], 0.5), (choice.roles[1], 0.5), (choice.roles[0], 0.5)):
        for subject in (here, there):
            subject.hold(role, force_n)
            light.append(subject._light)
    for one, other in zip(light[::2], light[1::2], strict=True):
        np.testing.assert_array_equal(one, other)
    assert not np.array_equal(light[0], light[4])  # the error of a force is drawn anew
