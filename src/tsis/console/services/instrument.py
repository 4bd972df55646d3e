"""The instrument: everything that pages and calls may ask of it."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import LARGEST_TARGET
from tsis.calibration.frames import load_calibration
from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import load_probe
from tsis.console.services.calibrating import CalibrationSessions
from tsis.console.services.camera import ActiveCalibrationCheck, CameraController, CameraSearch
from tsis.console.services.captures import (
    PressToSave,
    SequenceRequest,
    begin_sequence,
    enter_target,
    force_at,
    gauge_force,
    require_same_phantom,
    save_press,
)
from tsis.console.services.choice import PLAIN, TARGET
from tsis.console.services.control import Commands, ControlLock
from tsis.console.services.frames import GelAnalysis, Watcher
from tsis.console.services.jobs import Jobs, estimate_title, tissue_title
from tsis.console.services.memory import (
    LIGHT_N,
    CalibrationMemory,
    InstrumentMemory,
    TissueReadings,
    interruption_message,
    read_tissue,
)
from tsis.console.services.state import InstrumentState, StoreCheck, camera_state, trouble_messages
from tsis.errors import ControlError, InputError, RecordsError
from tsis.imaging.colour import COLOUR_MAPS
from tsis.inclusion import InclusionPrior, estimate
from tsis.inclusion.estimation import stated_strain
from tsis.inclusion.tissue import prior_on_tissue
from tsis.instrument.discovery import connect
from tsis.model.require import require_integer, require_one_of
from tsis.present.page import Page
from tsis.records.provenance import environment
from tsis.records.recomputation import EstimationRequest, estimate_stored, recompute, require_options
from tsis.records.store import open_store
from tsis.records.values import ESTIMATES, REFERENCE_ROLES
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Self

    from tsis.calibration.frames import UsableCalibration
    from tsis.console.services.captures import SavedPress
    from tsis.console.services.choice import CameraChoice, InstrumentSettings, PressForce
    from tsis.console.services.frames import FrameAnalysis, PressMoment
    from tsis.console.services.jobs import Job
    from tsis.console.services.memory import TissueReading
    from tsis.instrument.acquisition import ReceivedFrame
    from tsis.instrument.camera import Camera
    from tsis.instrument.force_log import ForceLog
    from tsis.model.image import TactileImage
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredPress, Target, TargetRecord


FIRST_FORCES_N, SPHERE_FORCES_N = (0.5, 1.0), (0.7, 1.2)
NO_PRESS = "target {} must have a press on the target to be estimated; it has none (press it, save a snapshot)"


def estimate_target(
    store: Store,
    number: int,
    *,
    kind: str,
    presses: Sequence[str] | None,
    options: Mapping[str, Any],
    tissue: TissueReading | None = None,
    progress: Callable[[int, int], None],
) -> StoredEstimate:
    """Estimate from presses of a target and store the estimate.

    Parameters
    ----------
    store, number
        The target's store and number.
    kind
        ``"inclusion"`` or ``"hardness"``.
    presses
        Identities of the presses to use; those of `newest_presses` when None.
    options
        As of `tsis.records.recomputation.EstimationRequest`.
    tissue
        That the prior of an inclusion is moved to, where ``options`` has none.
    progress
        Called with (done, all) while the mechanics of a new probe are solved, and (1, 1) before the result is stored;
        what it raises ends the estimate, and nothing is stored.

    Raises
    ------
    RecordsError
        When the target has no press to estimate from, or a named press is not one of its presses.
    InputError, CalibrationError, NotCalibratedError
        As the estimates themselves.
    """
    record = store.record(store.target(number))
    chosen = newest_presses(record, kind, tissue=tissue) if presses is None else _named(record, presses)
    probe, calibration = _terms(chosen, number)
    if kind == ESTIMATES[0]:
        if tissue is not None:
            options = {"prior": asdict(prior_on_tissue(InclusionPrior(), tissue.young_kpa))} | dict(options)
        options = {"strain": stated_strain(press.settings for press in chosen)} | dict(options)
    estimate = estimate_stored(
        record,
        EstimationRequest(kind=kind, probe=probe, presses=chosen, calibration=calibration, options=options),
        progress=progress,
    )
    progress(1, 1)
    return store.add_estimate(
        record.target,
        estimate,
        kind=kind,
        presses=chosen,
        probe=probe,
        calibration=record.calibrations[calibration],
        options=options,
        environment=environment(),
    )


def require_estimable(
    store: Store, number: int, *, kind: str, presses: Sequence[str] | None, options: Mapping[str, Any]
) -> None:
    """Refuse what no estimate can be begun with; parameters as of `estimate_target`, `InputError` says why."""
    require_one_of("kind of estimate", kind, ESTIMATES)
    require_options(kind, options)
    if presses is not None and not (len(presses) > 0 and all(isinstance(press, str) for press in presses)):
        raise InputError(f"presses must be identities of presses, one at least; got {presses!r:.80}")
    require_integer("target", number, 1, LARGEST_TARGET, hint="number of the target")
    try:
        store.target(number)
    except InputError as error:  # the first press makes a target
        raise InputError(NO_PRESS.format(number)) from error


def warm_up(probe: str) -> None:
    """Estimate a simulated press, and report it: caches of every process, and what this one loads, are filled then."""
    from tsis.present.inclusion import estimate_pictures  # the process of a console loads them with the first picture
    from tsis.present.pdf import pdf_bytes

    rig = VirtualProbe(load_probe(probe), rng=np.random.default_rng(0), strain="small")
    phantom = load_phantom("size-8")
    frames, reference = ([rig.press(item, force_n=1.0)] for item in (phantom, phantom.without_inclusion()))
    found = estimate(frames, probe=rig.probe, calibration=rig.calibration, reference=reference, strain="small")
    pdf_bytes(Page(title="", subtitle="", pictures=estimate_pictures(found)))


def newest_presses(record: TargetRecord, kind: str, *, tissue: TissueReading | None = None) -> tuple[StoredPress, ...]:
    """The newest press of each role and force, among those with the probe and the calibration of the newest one.

    The light press of ``tissue`` is left out: a dome touches only in part under it.

    Presses of unknown force are all used: the force line distinguishes them. Presses at 0 N touch nothing, and no
    estimate can use them.
    """
    roles = ("target", REFERENCE_ROLES[kind])
    used = [press for press in record.presses if press.role in roles and press.force_n != 0]
    used = [press for press in used if tissue is None or press.id != tissue.press]
    on_target = [press for press in used if press.role == "target"]
    if not on_target:
        return ()
    terms = (on_target[-1].probe, on_target[-1].calibration)
    newest: dict[object, StoredPress] = {}
    for press in used:
        if (press.probe, press.calibration) == terms:
            newest[press.id if press.force_n is None else (press.role, press.force_n)] = press
    return tuple(press for press in used if press in newest.values())


def _named(record: TargetRecord, identities: Sequence[str]) -> tuple[StoredPress, ...]:
    by_identity = {press.id: press for press in record.presses}
    for identity in set(identities) - by_identity.keys():
        raise RecordsError(f"presses must be those of target {record.target.number}; {identity!r:.40} is none")
    return tuple(by_identity[identity] for identity in identities)


def _terms(presses: Sequence[StoredPress], number: int) -> tuple[str, str]:
    """The probe and the calibration that all presses share."""
    if not presses:
        raise RecordsError(NO_PRESS.format(number))
    (probe, calibration), *others = {(press.probe, press.calibration) for press in presses}
    if others:
        raise RecordsError("presses must be of one probe under one calibration; these are of several (choose fewer)")
    if calibration is None:
        raise RecordsError("presses must have been taken under a calibration to be estimated; these were not")
    return probe, calibration


class Instrument:
    """Camera, target, calibration and store; safe for several threads.

    A command names its caller's identity, ``by``, which must own the camera (`ControlLock.take`). Commands run in turn.
    Each raises `ControlError` when somebody else owns the camera, or another command lasts for seconds.

    ``before_estimates`` is called with the name of the probe when the camera has started: estimates come soon.

    Parameters
    ----------
    terms
        Folders and initial settings.
    connect_to
        Gives a live camera by its name, as `tsis.instrument.discovery.connect`.

    Raises
    ------
    TsisError
        When the calibration cannot be used or the store cannot be opened.
    """

    def __init__(self, terms: InstrumentSettings, *, connect_to: Callable[[str], Camera] = connect) -> None:
        # What can fail comes first, so that nothing is left running then.
        usable = None if terms.calibration is None else load_calibration(terms.calibration)
        self.store: Store = open_store(terms.store, kind=terms.kind, database=terms.database)
        if not self.store.database.read_only:
            self.store.erase_expired()
        self.control, self._store_check = ControlLock(), StoreCheck(self.store)
        self.jobs = Jobs(terms.workspace / "jobs.jsonl")
        self._tissues = TissueReadings(terms.workspace / "tissues.json")
        self._memory = InstrumentMemory(terms.workspace / "last-run.state")
        restored = self._memory.begin(terms.choice)
        self._commands, self.search = Commands(self.control), CameraSearch(self.jobs)
        choice, number = restored or (terms.choice, 1)
        self._calibrations = CalibrationMemory(terms.workspace / "active-calibrations")
        usable, brought_back = (usable, "") if usable else self._calibrations.of(choice)
        self._notices: tuple[str, ...] = (interruption_message(self.jobs.history.interrupted, restored), brought_back)
        self.terms, self._target = terms, number
        self._gauge: ForceLog | None = None
        self.before_estimates: Callable[[str], None] = lambda _: None
        self.camera_controller = CameraController(
            choice, changed=lambda: self._watcher.begin_anew(), connect_to=connect_to
        )
        self._active = ActiveCalibrationCheck(self.camera_controller, usable)
        self.calibrating = CalibrationSessions(
            terms.workspace / "calibrations",
            control=self.control,
            jobs=self.jobs,
            camera_controller=self.camera_controller,
            gauge=lambda: self._gauge,
        )
        self.gel = GelAnalysis(self.control, self._newest, lambda: self._watcher.begin_anew())
        self._watcher = Watcher(
            lambda: self.camera_controller.acquisition,
            lambda: self._active.now().compared,
            self._force,
            self.gel.analyse,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close camera, gauge and store; a running sequence is completed. A second call does nothing."""
        with ExitStack() as left:  # the last first, and each whatever becomes of the others
            left.callback(self.store.close)
            left.callback(self._memory.ended)
            if self._gauge is not None:
                left.callback(self._gauge.stop)
            left.callback(self.camera_controller.close)
            left.callback(self._watcher.close)
            left.callback(self.jobs.close)
            left.callback(self._commands.close)

    @property
    def calibration(self) -> UsableCalibration | None:
        """The active calibration: the chosen one, else the virtual probe's own; None while it does not fit."""
        return self._active.now().calibration

    @property
    def frame_analysis(self) -> FrameAnalysis | None:
        """Analysis of the newest frame; None without one."""
        return self._watcher.frame_analysis

    def moments(self) -> tuple[PressMoment, ...]:
        """Force and contact over the last minute, the newest last."""
        return self._watcher.moments()

    def newest_image(self) -> TactileImage | None:
        """The camera's newest frame with the scale of its pixels; None without one."""
        received = self._newest()
        return None if received is None else received.frame.tactile_image(mm_per_pixel=self.state().camera.mm_per_pixel)

    def state(self) -> InstrumentState:
        """The state that pages show; it never waits for the camera or a command."""
        active, gauge, sequence = self._active.now(), self._gauge, self._commands.sequence
        calibration, camera = active.calibration, camera_state(self.camera_controller, active.scale)
        if camera.rows and (sensor := self.gel.setup.sensor) is not None:  # whose own scale holds then
            camera = replace(camera, mm_per_pixel=sensor.scale_of(camera.columns, camera.rows))
        return InstrumentState(
            camera=camera,
            target=self._target,
            role=self.camera_controller.role,
            roles=self.camera_controller.choice.roles,
            force_n=self.camera_controller.force_n,
            calibration="" if calibration is None else calibration.calibration.name,
            calibration_identity="" if calibration is None else calibration.identity,
            frame_analysis=self.frame_analysis,
            owner=self.control.owner(),
            sequence=None if sequence is None else sequence.state(),
            jobs=self.jobs.states(),
            trouble=trouble_messages(
                camera,
                gauge,
                active.why,
                self._watcher.failure,
                store_gone=self._store_check.trouble(),
                notices=self._notices,
            ),
            busy=self._commands.busy,
            gauge="" if gauge is None else gauge.name,
            active=calibration,
            tissue=self._tissues.of(self._target),
            notices=self._notices,
            good_news=() if self._active.chosen is None else self._notices[1:],
        )

    def choose(self, choice: CameraChoice, *, by: str) -> None:
        """Choose another camera, not yet started, with its last calibration; the chosen one stays where it has none."""
        with self._commands.run(by, "choosing a camera", instead="another camera can be chosen"):
            self.camera_controller.choose(choice)
            if (before := self._calibrations.of(choice)[0]) is not None:
                self._active.chosen = before
            self._keep()
            self._watcher.begin_anew()

    def start(self, *, by: str) -> None:
        """Start the camera; errors as `CameraController.start`. When it runs already, nothing happens."""
        with self._commands.run(by, "starting the camera"):
            self.camera_controller.start()
            self._notices = ()  # they were read, and work goes on
            self.before_estimates(self._active.now().probe)

    def close_notice(self, message: str) -> None:
        """Show a message of the start no more: somebody has read it."""
        self._notices = tuple("" if notice == message else notice for notice in self._notices)

    def stop(self, *, by: str) -> None:
        """Stop the camera."""
        with self._commands.run(by, "stopping the camera", instead="the camera can be stopped"):
            self.camera_controller.stop()

    def adjust(self, name: str, value: float, *, by: str) -> None:
        """Change a setting of the camera; errors as `Acquisition.adjust`."""
        with self._commands.run(by, "changing a setting"):
            self.camera_controller.adjust(name, value)

    def preset(self, name: str, *, by: str) -> None:
        """Make all settings of a preset: ``"default"`` or ``"minimal"``."""
        with self._commands.run(by, "changing settings"):
            self.camera_controller.preset(name)

    def set_target(self, number: int, *, by: str) -> None:
        """Choose the target that snapshots go to, in [1, 99999]."""
        with self._commands.run(by, "choosing a target"):
            self._target = require_integer("target", number, 1, LARGEST_TARGET, hint="number of the target")
            self._keep()

    def step_target(self, many: int, *, by: str) -> None:
        """Choose the target so many after the present one, whichever that is when it is done; before where negative."""
        with self._commands.run(by, "choosing a target"):
            self._target = require_integer(
                "target", self._target + many, 1, LARGEST_TARGET, hint="number of the target"
            )
            self._keep()

    def hold(self, *, role: str | None = None, force_n: float | None = None, forget: bool = False, by: str) -> None:
        """Set role and force of the press; the virtual probe moves there.

        Raises `InputError` or `MechanicsError` when it cannot be pressed so, and the press stays as it was;
        `ControlError` for another role than that of the running sequence.
        """
        with self._commands.run(
            by, "moving the probe" if self.camera_controller.choice.is_virtual else "noting the press"
        ):
            requested, force_n = self.camera_controller.completed(role, force_n, forget=forget)
            if requested != self.camera_controller.role:
                self._commands.require_no_sequence("something else can be pressed")
            self.camera_controller.hold(requested, force_n)
            self._watcher.begin_anew()

    def forget_force(self, *, by: str) -> None:
        """Set the force to unknown; the virtual probe's is always known."""
        self.control.require(by)
        if not self.camera_controller.choice.is_virtual:
            self.hold(forget=True, by=by)

    def use_calibration(self, calibration: UsableCalibration | None, *, by: str) -> None:
        """Activate a calibration; None for the virtual probe's own, or none.

        Raises `CalibrationError` when it is expired, or of another probe, camera, setting or size of frames.
        """
        with self._commands.run(by, "activating a calibration", instead="another calibration can be activated"):
            self._active.use(calibration)
            self._calibrations.keep(self.camera_controller.choice, calibration)
            self._watcher.begin_anew()

    def use_gauge(self, log: ForceLog | None, *, by: str) -> None:
        """Read forces from a started gauge, which is stopped when the next one is given; None for no gauge."""
        with self._commands.run(by, "changing the gauge", instead="another gauge can be used"):
            before, self._gauge = self._gauge, log
            if before is not None and before is not log:
                before.stop()

    def snapshot(self, *, by: str, map_name: str = "viridis") -> SavedPress:
        """Save the present press: its files, and the press in the store.

        Raises `CameraError` without a frame, `GaugeError` without a force of the gauge, `FileInputError` when the files
        cannot be written (nothing is saved then), `RecordsError` when the store refuses the press (its files stay).
        """
        require_one_of("colour map", map_name, COLOUR_MAPS)
        with self._commands.run(by, "saving a press"):
            self.camera_controller.refresh()  # somebody may have changed a setting elsewhere
            received, gauge = self.camera_controller.fresh(), self._gauge
            force = self._force(received) if gauge is None else gauge_force(gauge, received)
            press = PressToSave(
                received=received,
                force=force,
                role=self.camera_controller.role,
                active=self._active.now(),
                subject=self.camera_controller.subject,
            )
            return save_press(
                press,
                number=self._target,
                workspace=self.terms.workspace,
                store=self.store,
                map_name=map_name,
            )

    def take_presses(self, *, by: str) -> tuple[SavedPress, ...]:
        """Have the virtual probe press target and reference, a sphere alone, with two forces, and save every press.

        The forces are those of the target's tissue where it was read. Raises as `hold` and `snapshot`, and
        `ControlError` for another camera.
        """
        choice = self.camera_controller.choice
        if not choice.is_virtual:
            raise ControlError("only the virtual probe presses by itself; press the target, and save a snapshot")
        tissue = self._tissues.of(self._target)
        forces_n = SPHERE_FORCES_N if choice.is_sphere else FIRST_FORCES_N if tissue is None else tissue.forces_n
        saved = []
        for role in (TARGET,) if choice.is_sphere else (TARGET, PLAIN):
            for force_n in forces_n:
                self.hold(role=role, force_n=force_n, by=by)
                saved.append(self.snapshot(by=by))
        return tuple(saved)

    def read_tissue(self, *, by: str) -> Job:
        """Save the present light press on tissue without an inclusion, and read the tissue from it in the background.

        The virtual probe makes that press itself. The job's result is the `TissueReading`, which says the forces to
        press with, and whose tissue the prior of this target's estimates is for. Raises as `hold` and `snapshot`, and
        `ControlError` while something else is pressed.
        """
        if self.camera_controller.choice.is_sphere:
            raise ControlError("tissue must be under the probe to be measured; it is a sphere (choose a phantom)")
        if self.camera_controller.choice.is_virtual:
            self.hold(role=PLAIN, force_n=LIGHT_N, by=by)
        elif self.camera_controller.role != PLAIN:
            raise ControlError(
                "tissue is measured with a reference press; choose the reference first, and press lightly"
            )
        saved = self.snapshot(by=by)
        number, press = saved.target.number, saved.press.id

        def work(job: Job) -> TissueReading:
            reading = read_tissue(self.store.record(self.store.target(number)), press)
            self._tissues.add(number, reading)
            return reading

        return self.jobs.begin(tissue_title(number), work)

    def begin_sequence(self, *, seconds: float | None = None, frames: int | None = None, by: str) -> Job:
        """Record every frame for a number of frames or seconds; it continues when the browser closes.

        Its target is entered in the store, so that the sequence has a page. Errors as `SequenceRequest`,
        `begin_sequence` and `save_press`; `ControlError` while a sequence runs.
        """
        with self._commands.run(by, "beginning a sequence", instead="another sequence can begin"):
            request = SequenceRequest(target=self._target, seconds=seconds, frames=frames)
            subject = self.camera_controller.subject
            if subject is not None:
                require_same_phantom(self.store, subject, self._target)
            self._commands.sequence = sequence = begin_sequence(
                self.jobs,
                self.camera_controller.acquisition,
                request,
                workspace=self.terms.workspace,
                gauge=self._gauge,
                typed_n=lambda: self.camera_controller.force_n,
                about=self._about,
            )
            enter_target(self.store, subject, self._target)  # not before the folder was made
            return sequence

    def end_sequence(self, *, by: str) -> None:
        """End the running sequence; recorded frames stay. Without one nothing happens."""
        self.control.require(by)
        if self._commands.sequence is not None:
            self._commands.sequence.end()

    def end_job(self, identity: str, *, by: str) -> Job:
        """Cancel a job; a job of the camera only by its owner, else `ControlError`. `InputError` for an unknown job."""
        job = self.jobs.get(identity)
        if job.follows_camera:
            self.control.require(by)
        job.end()
        return job

    def estimate(
        self,
        number: int,
        *,
        kind: str = "inclusion",
        presses: Sequence[str] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> Job:
        """Estimate a stored target in the background; the job's result is the `StoredEstimate`. It needs no camera.

        Parameters as of `estimate_target`; `InputError` when there is no such target or kind, or an option is unknown.
        """
        options = options or {}
        require_estimable(self.store, number, kind=kind, presses=presses, options=options)
        return self.jobs.begin(
            estimate_title(number),
            lambda job: estimate_target(
                self.store,
                number,
                kind=kind,
                presses=presses,
                options=options,
                tissue=self._tissues.of(number),
                progress=job.advance,
            ),
        )

    def recompute(self, target: Target, *, dry_run: bool) -> Job:
        """Recompute the current estimates of a target in the background; the result is the `Recomputation` of each."""
        return self.jobs.begin(
            f"recomputation of target {target.number}",
            lambda job: recompute(self.store, target, dry_run=dry_run, progress=job.advance),
        )

    def _keep(self) -> None:
        self._memory.keep(self.terms.choice, self.camera_controller.choice, self._target)

    def _about(self) -> dict[str, Any]:
        """What is recorded, as the camera is set now."""
        self.camera_controller.refresh()  # somebody may have changed a setting elsewhere
        return {"role": self.camera_controller.role, **self._active.now().sidecar_entries()}

    def _force(self, frame: ReceivedFrame) -> PressForce | None:
        return force_at(frame, self._gauge, self.camera_controller.force_n)

    def _newest(self) -> ReceivedFrame | None:
        acquisition = self.camera_controller.acquisition
        return None if acquisition is None else acquisition.latest()
