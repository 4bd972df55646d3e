"""Readings by the virtual probe, and CSV tables of other devices."""

from __future__ import annotations

import hashlib
import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import LARGEST_SEED, __version__
from tsis.calibration.file import ProbeCalibration, calibration_sha256
from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import load_probe
from tsis.errors import FileInputError, InputError, MechanicsError, RecordsError, import_extra
from tsis.files.reading import as_path, file_error, one_line, printable_name, read_bytes
from tsis.files.tables import LARGEST_CSV_BYTES, CsvRow, parse_csv_rows, read_csv_rows, table_bytes
from tsis.inclusion import InclusionPrior, estimate
from tsis.inclusion.estimation import STRAINS
from tsis.inclusion.flags import presence_caveats
from tsis.inclusion.reading import press_tables
from tsis.model.estimate import INTERVAL_LEVEL
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.require import require_integer, require_number, require_one_of
from tsis.optics.face_light import irradiance
from tsis.study.folder import PLAN, enter_readings, open_study, read_seal, user
from tsis.study.log import run_lock
from tsis.study.plan import MOST_REPEATS, QUANTITIES, DeviceReading, TargetTruth, require_short_name
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Sequence

    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage
    from tsis.optics.face_light import Irradiance
    from tsis.records.store import Store
    from tsis.study.folder import Study


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

    Raises `InputError` when a value lies outside its range; `RecordsError` when the study is unblinded, its files were
    changed, or another run is active.

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
            kept = ProbeCalibration(name=calibration.name, probe=plan.probe, response=calibration)
            evidence["calibration_sha256"] = calibration_sha256(kept)
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
            from tsis.records.importing import SavableResult, save_results

            savable = SavableResult(
                kind="inclusion",
                estimate=result,
                probe=plan.probe,
                calibration=kept,
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


COLUMNS = ("label", "diameter_mm", "depth_mm", "young_kpa")
MORE_COLUMNS = ("offset_mm", "tissue_kpa", "thickness_mm", "poisson")


def read_truth_table(path: str | os.PathLike[str]) -> tuple[TargetTruth, ...]:
    """Read targets from a CSV file in UTF-8 with the columns `COLUMNS`, and optionally `MORE_COLUMNS`.

    A row whose diameter, depth and modulus are empty is a target without an inclusion; other empty cells are as in the
    phantom ``detection-blank`` of the catalog. Raises `FileInputError` when a row is no target, with its line.
    """
    file = as_path(path)
    by_label: dict[str, TargetTruth] = {}
    for row in read_csv_rows(file, COLUMNS, MORE_COLUMNS):
        target = _target(row)
        if target.label in by_label:
            raise row.refused("label", "different in every row", target.label)
        by_label[target.label] = target
    if not by_label:
        raise file_error(file, "must hold at least one target; it has headings alone")
    return tuple(by_label.values())


def _target(row: CsvRow) -> TargetTruth:
    usual = load_phantom("detection-blank")
    numbers = {name: row.number(name) for name in (*COLUMNS[1:], *MORE_COLUMNS)}
    filled = [name for name in COLUMNS[1:] if numbers[name] is not None]
    if filled and len(filled) < len(COLUMNS) - 1:
        lost = next(name for name in COLUMNS[1:] if name not in filled)
        raise row.refused(lost, f"given where {filled[0]} is, or all three empty", "")
    values = dict(zip(MORE_COLUMNS, (0.0, usual.young_kpa, usual.thickness_mm, usual.poisson), strict=True))
    values |= {name: value for name, value in numbers.items() if value is not None}
    offset, tissue, thickness, poisson = (values[name] for name in MORE_COLUMNS)
    try:
        lump = None
        if filled:
            diameter, depth, young = (values[name] for name in COLUMNS[1:])
            lump = Inclusion(
                diameter_mm=diameter, depth_mm=depth, young_kpa=young, poisson=poisson, offset_mm=(offset, 0.0)
            )
        phantom = Phantom(young_kpa=tissue, thickness_mm=thickness, poisson=poisson, inclusion=lump)
        return TargetTruth(label=row.text("label"), phantom=phantom)
    except InputError as error:
        raise FileInputError(f"{error} ({row.where})") from error


READING_COLUMNS = ("code", "score", "operator", "repeat", *QUANTITIES)
UNCERTAINTY_COLUMNS = tuple(f"{name}{ending}" for name in QUANTITIES for ending in ("_sd", "_low", "_high"))
NO_RESPONSE = "the device gave no result"


def import_readings(
    study: Study,
    path: str | os.PathLike[str],
    *,
    device: str,
    threshold: float | None = None,
    actor: str = "",
) -> Study:
    """Enter the readings of a device from a CSV file in UTF-8 with the columns `READING_COLUMNS`, all or none.

    An empty score is an undecided reading; sizes, depths and moduli may be empty. `UNCERTAINTY_COLUMNS` may follow: the
    standard deviation of a quantity, and both ends of its 90 % interval. Repeats count from 1 to those of the plan. The
    ``threshold``, least score of a target that is called one with an inclusion, is that of the study by default, for
    scores from 0 to 1; the first import of a device fixes it. Raises `InputError` when a row is invalid, with its line,
    and `RecordsError` when the study is unblinded.
    """
    file = as_path(path)
    return import_table(
        study,
        read_bytes(file, most=LARGEST_CSV_BYTES),
        printable_name(file),
        device=device,
        threshold=threshold,
        actor=actor,
    )


def import_table(
    study: Study, content: bytes, name: str, *, device: str, threshold: float | None = None, actor: str = ""
) -> Study:
    """Enter the content of an uploaded file; as `import_readings`."""
    require_short_name("device", device)
    if device == study.plan.device:
        raise InputError(
            f"device must not be {device!r:.60}, which tsis study run reads with (choose another name)", name="device"
        )
    limit = _threshold(study, device, threshold)
    unknown = threshold is None and device not in study.devices
    readings: dict[tuple[str, str, str, int], DeviceReading] = {}
    places: dict[tuple[str, str, str, int], str] = {}
    entered, codes = {reading.key for reading in study.readings}, frozenset(study.plan.codes)
    for row in parse_csv_rows(content, name, READING_COLUMNS, UNCERTAINTY_COLUMNS):
        reading = _reading(row, codes, device, study.plan.repeats)
        if unknown and reading.score is not None and not 0 <= reading.score <= 1:
            raise row.refused(
                "score",
                "a probability from 0 to 1 where no threshold is given (give the least score that means an inclusion)",
                row.text("score"),
            )
        if reading.key in readings or reading.key in entered:
            raise FileInputError(
                f"code, operator and repeat must be together but once for a device; {reading.code}, "
                f"{reading.operator!r:.60} and {reading.repeat} are there already ({row.where})"
            )
        readings[reading.key], places[reading.key] = reading, row.where
    known = readings.keys() | entered
    for key, where in places.items():
        if (*key[:3], 1) not in known:
            raise FileInputError(
                f"repeat must count from 1 for each target and operator; {key[0]} has {key[3]} of {key[2]!r:.60} "
                f"without 1 ({where}): enter it too, its score empty where the device gave none"
            )
    if not readings:
        raise FileInputError(f"{name} must hold at least one reading; it has headings alone")
    document: dict[str, Any] = {
        "device": device,
        "threshold": limit,
        "file": name,
        "sha256": hashlib.sha256(content).hexdigest(),
        "readings": len(readings),
        "tsis": __version__,
    }
    return enter_readings(study, list(readings.values()), actor=actor or user(), imported=document)


def threshold_note(study: Study, device: str) -> str:
    """One sentence where all scores of a device, two or more, lie on one side of its threshold; else empty."""
    scores = [item.score for item in study.readings if item.device == device and item.score is not None]
    limit = study.threshold_of(device)
    above = sum(score >= limit for score in scores)
    if len(scores) < 2 or 0 < above < len(scores):
        return ""
    side, called = ("at or above", "one with an inclusion") if above else ("below", "one without an inclusion")
    return (
        f"All {len(scores)} scores of {device} lie {side} its threshold, {limit:g}, so each target is called {called}; "
        "the threshold is fixed: if it is wrong, import under another name of the device."
    )


def _threshold(study: Study, device: str, threshold: float | None) -> float:
    before = study.threshold_of(device)
    if threshold is None:
        return before
    require_number("threshold", threshold, -1e12, 1e12)
    if device in study.devices and threshold != before:
        raise InputError(
            f"threshold must stay what it was when the first readings of {device!r:.60} came in, {before:g}; "
            f"got {threshold:g}"
        )
    return float(threshold)


def _reading(row: CsvRow, codes: frozenset[str], device: str, repeats: int) -> DeviceReading:
    code, repeat = row.text("code"), row.number("repeat")
    if code not in codes:
        raise row.refused("code", "one of this study's codes", code)
    if repeat is None or not repeat.is_integer():
        raise row.refused("repeat", "a whole number from 1", row.text("repeat"))
    if repeats < repeat <= MOST_REPEATS:
        asked = f"at most {repeats}, which the plan asks for (tsis study new --repeats makes a study with more)"
        raise row.refused("repeat", asked, row.text("repeat"))
    score = row.number("score")
    values = {name: value for name in QUANTITIES if (value := row.number(name)) is not None}
    intervals = {name: ends for name in QUANTITIES if (ends := _interval(row, name)) is not None}
    try:
        return DeviceReading(
            code=code,
            device=device,
            operator=row.text("operator"),
            repeat=int(repeat),
            score=score,
            reason=NO_RESPONSE if score is None else "",
            values=values,
            sd={name: sd for name in QUANTITIES if (sd := row.number(f"{name}_sd")) is not None},
            interval_90=intervals,
        )
    except InputError as error:
        raise FileInputError(f"{error} ({row.where})") from error


def _interval(row: CsvRow, quantity: str) -> tuple[float, float] | None:
    low, high = row.number(f"{quantity}_low"), row.number(f"{quantity}_high")
    if low is None and high is None:
        return None
    if low is None or high is None or not 0 <= low <= high:
        limits = f"{row.text(f'{quantity}_low')} and {row.text(f'{quantity}_high')}"
        raise row.refused(f"{quantity}_low and {quantity}_high", "given together, from 0 upwards", limits)
    value = row.number(quantity)
    if value is not None and not low <= value <= high:
        wanted = f"between {quantity}_low and {quantity}_high, {low:g} and {high:g}, which are in its unit"
        raise row.refused(quantity, wanted, row.text(quantity))
    return low, high


def export_readings(study: Study, device: str | None = None) -> bytes:
    """Readings of a device, by default the only one, in the format of `import_readings`, without the truth.

    `UNCERTAINTY_COLUMNS` follow where a reading has a standard deviation or an interval.

    Raises `InputError` when that device has no readings, or several devices exist and none is named.
    """
    if device is None:
        if len(study.devices) != 1:
            raise InputError(
                f"device must be named where there is not exactly one; this study has readings of "
                f"{', '.join(study.devices) or 'none'}"
            )
        device = study.devices[0]
    readings = [reading for reading in study.readings if reading.device == device]
    if not readings:
        raise InputError(f"device must be one that has readings, {', '.join(study.devices)}; got {device!r:.60}")
    more = UNCERTAINTY_COLUMNS if any(item.sd or item.interval_90 for item in readings) else ()
    rows: list[list[Any]] = [[*READING_COLUMNS, *more]]
    for item in readings:
        numbers = {name: value for name, value in quantity_columns(item).items() if not math.isnan(value)}
        rows.append([item.code, item.score, item.operator, item.repeat, *map(numbers.get, (*QUANTITIES, *more))])
    return table_bytes(rows)


def readings_table(study: Study) -> Any:
    """All readings of a study as a ``pandas.DataFrame``, a row each, without the truth.

    The columns are code, device, operator, repeat, score, rank, undecided, reason and flags; and for each quantity of
    `QUANTITIES` the value, its standard deviation ``..._sd`` and the 90 % interval ``..._low`` and ``..._high``. What a
    device does not give is NaN. Raises `MissingExtraError` without the extra ``analysis``.
    """
    pandas = import_extra("pandas", feature="a table of readings", extra="analysis")
    return pandas.DataFrame([_reading_row(reading) for reading in study.readings], columns=list(TABLE_COLUMNS))


def _reading_row(reading: DeviceReading) -> dict[str, Any]:
    return {
        **{name: getattr(reading, name) for name in ("code", "device", "operator", "repeat", "undecided", "reason")},
        **{name: _number_or_nan(getattr(reading, name)) for name in ("score", "rank")},
        "flags": ", ".join(reading.flags),
        **quantity_columns(reading),
    }


def quantity_columns(reading: DeviceReading | None) -> dict[str, float]:
    """Value, standard deviation and 90 % interval of each quantity, NaN where a reading has none."""
    columns: dict[str, float] = {}
    for name in QUANTITIES:
        low, high = (None, None) if reading is None else reading.interval_90.get(name, (None, None))
        parts = {
            "": None if reading is None else reading.values.get(name),
            "_sd": None if reading is None else reading.sd.get(name),
            "_low": low,
            "_high": high,
        }
        columns |= {f"{name}{ending}": _number_or_nan(value) for ending, value in parts.items()}
    return columns


def _number_or_nan(value: float | None) -> float:
    return math.nan if value is None else value


TABLE_COLUMNS = (
    *("code", "device", "operator", "repeat", "score", "rank", "undecided", "reason", "flags"),
    *quantity_columns(None),
)
