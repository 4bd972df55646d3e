"""Readings of a study's targets by the virtual probe."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import LARGEST_SEED, __version__
from tsis.calibration.file import ProbeCalibration, calibration_sha256
from tsis.catalog import load_probe
from tsis.errors import InputError, MechanicsError, RecordsError
from tsis.files import one_line
from tsis.inclusion import STRAINS, InclusionPrior, estimate, presence_caveats, press_tables
from tsis.model import INTERVAL_LEVEL, require_integer, require_one_of
from tsis.optics.irradiance import irradiance
from tsis.study._folder import PLAN, enter_readings, open_study, read_seal, user
from tsis.study._log import run_lock
from tsis.study._values import QUANTITIES, DeviceReading, require_short_name
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.model import Calibration, Phantom, TactileImage
    from tsis.optics.irradiance import Irradiance
    from tsis.records.store import Store
    from tsis.study._folder import Study
    from tsis.study._values import TargetTruth


NOT_TRUSTED = "the estimate is not to be trusted"
NOT_PRESSED = "the press could not be computed"  # the cause would reveal the truth


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyInstrument:
    """One probe for all readings of a study, instead of one drawn anew for each, and how its frames are corrected.

    ``corrected`` turns raw frames into those of the calibration, with the response that the estimates use; without it
    they use the probe's own nominal calibration.
    """

    virtual: VirtualProbe
    corrected: Callable[[Sequence[TactileImage]], tuple[Sequence[TactileImage], Calibration]] | None = None

    def known(self, *series: Sequence[TactileImage]) -> tuple[tuple[list[TactileImage], ...], Calibration]:
        """Corrected series of frames, and the response of their grey levels."""
        if self.corrected is None:
            return tuple(list(frames) for frames in series), self.virtual.calibration
        ready, response = zip(*(self.corrected(frames) for frames in series if frames), strict=True)
        filled = iter(ready)
        return tuple(list(next(filled)) if frames else [] for frames in series), response[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult:
    """The updated study, the numbers of new and of undecided readings, and that of readings still missing."""

    study: Study
    entered: int
    undecided: int
    left: int


def press_study(
    study: Study,
    *,
    operator: str = "",
    seed: int = 0,
    strain: str = "finite",
    save: Store | None = None,
    instrument: StudyInstrument | None = None,
    progress: Callable[[int, int], None] | None = None,
    preparing: Callable[[int, int], None] | None = None,
    ended: Callable[[], bool] | None = None,
) -> RunResult:
    """Press the targets that an operator has still to read, estimate, and enter each reading at once.

    The errors of each reading follow from the seed, the code, the operator and the repeat, so an interrupted run
    continues with the readings of an uninterrupted one. Neither the log nor the store contains the truth.

    Parameters
    ----------
    study
        The study, blind and unchanged.
    operator
        Operator of the probe; the user of this machine by default. Each operator reads every target.
    seed
        Of the probe's errors.
    strain
        Mechanics of the presses and of the estimates: ``"finite"``, seconds a press, or ``"small"``.
    save
        Store of phantoms for frames, calibration and estimate under each code.
    instrument
        The probe of all readings; None draws another probe of the plan's kind for each.
    progress
        Called with (done, total) readings.
    preparing
        Called with (done, total) while the model of this probe is built, which is cached.
    ended
        Called before each reading; True stops the run.

    Raises
    ------
    InputError
        When a value lies outside its range.
    RecordsError
        When the study is unblinded, its files were changed, or another run is active.
    """
    operator = require_short_name("operator", operator or user())
    require_integer("seed", seed, 0, LARGEST_SEED)
    require_one_of("strain", strain, STRAINS)
    seal, unchanged = read_seal(study)
    if not unchanged:
        raise RecordsError(
            "the sealed truth must be the one that was sealed; it was changed (tsis study verify tells more)"
        )
    if study.unblinded is not None:
        raise RecordsError(
            "readings must be entered before a study is unblinded; this one is unblinded, so nothing was pressed"
        )
    with run_lock(study.folder / PLAN):
        study = open_study(study.folder)  # another run may just have ended
        left = study.missing(study.plan.device, operator)
        rig = None if not left else _Rig.of(study, strain, preparing, instrument)
        entered = undecided = 0
        for done, (code, repeat) in enumerate(left):
            if progress is not None:
                progress(done, len(left))
            if ended is not None and ended():
                break
            assert rig is not None
            reading = rig.read(seal.truths[code], save, code=code, operator=operator, repeat=repeat, seed=seed)
            study = enter_readings(study, [reading], actor=operator)
            entered, undecided = entered + 1, undecided + reading.undecided
    if progress is not None and left:
        progress(entered, len(left))
    return RunResult(study=study, entered=entered, undecided=undecided, left=len(left) - entered)


def _rng(seed: int, code: str, operator: str, repeat: int) -> np.random.Generator:
    """Generator for the errors of one reading, independent of the others."""
    named_by = hashlib.sha256(f"{code}\0{operator}\0{repeat}".encode()).digest()
    return np.random.default_rng([seed, *np.frombuffer(named_by, dtype=np.uint32).tolist()])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rig:
    """The probe of a study, its light and the prior."""

    study: Study
    instrument: StudyInstrument | None
    light: Irradiance
    prior: InclusionPrior
    strain: str

    @classmethod
    def of(
        cls,
        study: Study,
        strain: str,
        preparing: Callable[[int, int], None] | None,
        instrument: StudyInstrument | None,
    ) -> _Rig:
        probe, prior = load_probe(study.plan.probe), InclusionPrior()
        light = irradiance(probe, progress=preparing)
        press_tables(probe, prior, strain, progress=preparing)
        return cls(study=study, instrument=instrument, light=light, prior=prior, strain=strain)

    def read(
        self, truth: TargetTruth, store: Store | None, *, code: str, operator: str, repeat: int, seed: int
    ) -> DeviceReading:
        """Press one target and estimate."""
        plan, rng = self.study.plan, _rng(seed, code, operator, repeat)
        blank = DeviceReading(code=code, device=plan.device, operator=operator, repeat=repeat, score=None)
        own = self.instrument
        if own is None:
            own = StudyInstrument(
                virtual=VirtualProbe(load_probe(plan.probe), rng=rng, light=self.light, strain=self.strain)
            )
            virtual = own.virtual
        else:
            virtual = own.virtual.aged(rng)
        evidence: dict[str, Any] = {"tsis": __version__, "seed": seed, "strain": self.strain}
        try:
            targets, references = self._frames(virtual, truth.phantom, rng, code)
        except (InputError, MechanicsError):
            return replace(blank, reason=NOT_PRESSED, evidence=evidence)
        evidence["frames_sha256"] = _digest(targets + references)
        evidence["prior"] = str(self.prior)
        try:
            (targets, references), calibration = own.known(targets, references)
            saved = ProbeCalibration(name=calibration.name, probe=plan.probe, response=calibration)
            evidence["calibration_sha256"] = calibration_sha256(saved)
            result = estimate(
                targets,
                probe=virtual.probe,
                calibration=calibration,
                reference=references,
                prior=self.prior,
                strain=self.strain,
            )
        except (InputError, MechanicsError) as error:
            return replace(blank, reason=one_line(error), evidence=evidence)
        if store is not None:
            from tsis.records import SavableResult, save_results

            savable = SavableResult(
                kind="inclusion",
                estimate=result,
                probe=plan.probe,
                calibration=saved,
                frames={"target": targets, "plain": references},
                options={"prior": asdict(self.prior), "strain": self.strain},
                name=code,  # the only sign of the target
            )
            evidence["kept_as"] = int(save_results(store, savable)["target"])
        caveats = presence_caveats(result.flags)
        if caveats or result.presence is None:
            reason = f"{NOT_TRUSTED}: {', '.join(sorted(caveats))}"
            return replace(blank, reason=reason, flags=result.flags, evidence=evidence)
        score = float(result.presence)
        reading = replace(blank, score=score, rank=result.log_bayes_factor, flags=result.flags, evidence=evidence)
        if not result.trusted:  # no inclusion to measure
            return reading
        return replace(
            reading,
            values={name: result.mean[name] for name in QUANTITIES if name in result.mean},
            sd={name: result.sd[name] for name in QUANTITIES if name in result.sd},
            interval_90=result.interval(INTERVAL_LEVEL),
        )

    def _frames(
        self, virtual: VirtualProbe, phantom: Phantom, rng: np.random.Generator, code: str
    ) -> tuple[list[TactileImage], list[TactileImage]]:
        """Frames of the target and of nearby tissue, which is a little softer or stiffer; named by the code."""
        plan = self.study.plan
        softer = float(np.exp(virtual.calibration.site_sd * rng.standard_normal()))
        site = replace(phantom.without_inclusion(), young_kpa=softer * phantom.young_kpa)
        pressed = {"target": phantom, **({"plain": site} if plan.with_reference else {})}
        frames = {
            what: [
                replace(virtual.press(slab, force_n=force), name=f"{code}-{what}-{force:g}N.png")
                for force in plan.forces_n
            ]
            for what, slab in pressed.items()
        }
        return frames["target"], frames.get("plain", [])


def _digest(frames: list[TactileImage]) -> str:
    """SHA-256 of the grey levels of all frames, in single precision, which represents 16 bits exactly."""
    digest = hashlib.sha256()
    for frame in frames:
        digest.update(frame.grey.astype(np.float32).tobytes())
    return digest.hexdigest()
