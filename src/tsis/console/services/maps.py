"""Maps of lumps: scans, jobs, and where maps are kept."""

from __future__ import annotations

import re
import shutil
import tempfile
import weakref
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tsis.catalog.probes import load_probe
from tsis.console.services.jobs import JobCancelled
from tsis.console.statuses import AbsentError
from tsis.errors import InputError, RecordsError, TsisError
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import json_bytes
from tsis.files.result_folder import free_folder, write_folder
from tsis.mapping.estimation import estimate_map
from tsis.mapping.scan_folder import POSES_FILE, calibrated, read_scan, scan_files
from tsis.mapping.stiffness import suited_prior
from tsis.present.html import html_bytes
from tsis.present.lump_map import guide_page, map_report
from tsis.records.importing import enter_map
from tsis.records.places import placed_presses, recorded_calibration, recorded_scan
from tsis.virtual.scan import THREE_LUMPS, grid_places, virtual_scan

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.calibration.frames import UsableCalibration
    from tsis.console.services.jobs import Job
    from tsis.mapping.lump_map import LumpMap
    from tsis.mapping.prior import MapPrior
    from tsis.mapping.scan import Indenter
    from tsis.mapping.scan_folder import StoredScan
    from tsis.present.page import Page
    from tsis.records.store import Store
    from tsis.records.values import StoredPress, Target


FOLDER = "maps"
RESULT, PAGE = "result.json", "index.html"
UPLOADED, SIMULATED, SIMULATED_PROBE = "uploaded-scan", "simulated-scan", "tsis-2011"
PRESSES_A_SIDE, SPACING_MM = 5, 10.0
STEPS, GUIDE_STEPS = 20_000, 1000  # of the sampler: of a map that is kept, and of an update by a press
VOXEL_MM, SEED = 2.0, 0
DRAWN = 15  # the steps of a map over those of its report, which follows
NAME = re.compile(r"[A-Za-z0-9_-]{1,80}", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetScan:
    """The scan of a stored target, whose map is kept there; ``calibration`` is None where its presses cite none."""

    store: Store
    target: Target
    presses: tuple[StoredPress, ...]
    stored: StoredScan
    calibration: UsableCalibration | None


def target_scan(store: Store, number: int) -> TargetScan:
    """The scan of the target of this number; errors as `recorded_scan` and `recorded_calibration`."""
    record = store.record(store.target(number))
    if store.kind == "subject":  # the name of a file may be that of a person
        numbered = enumerate(record.presses, 1)
        record = replace(record, presses=tuple(replace(press, name=f"press {at}") for at, press in numbered))
    return TargetScan(
        store=store,
        target=record.target,
        presses=placed_presses(record),
        stored=recorded_scan(record),
        calibration=recorded_calibration(record),
    )


class OpenedScan:
    """The scan that a tab has opened; uploaded files lie in a folder that goes with it."""

    def __init__(self) -> None:
        folder = Path(tempfile.mkdtemp(prefix="tsis-scan-"))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self.uploads = folder / UPLOADED  # whose name is that of the map
        self.uploads.mkdir()
        self.source: Path | None = None
        self.simulated = False
        self._target: tuple[Store, int] | None = None

    @property
    def chosen(self) -> bool:
        """Whether there is a scan to be read."""
        return self.source is not None or self._target is not None

    def open(self, source: Path) -> None:
        """Choose a folder or a table of the console's computer."""
        self.source, self.simulated, self._target = source, False, None

    def open_target(self, store: Store, number: int) -> None:
        """Choose the scan of a stored target; `InputError` when the store has none of this number."""
        store.target(number)
        self.source, self.simulated, self._target = None, False, (store, number)

    def of_target(self) -> TargetScan | None:
        """The scan of the chosen target; None where files are chosen."""
        return None if self._target is None else target_scan(*self._target)

    def uploaded(self, file: Path) -> None:
        """Choose the folder of the uploaded files once its table of places is there, until then the newest file."""
        self.open(self.uploads if (self.uploads / POSES_FILE).is_file() else file)

    def clear(self) -> None:
        """Forget the scan and the uploaded files."""
        shutil.rmtree(self.uploads, ignore_errors=True)
        self.uploads.mkdir(exist_ok=True)
        self.source, self.simulated, self._target = None, False, None

    def simulate(self, seed: int) -> None:
        """Choose a scan of the virtual flat probe over three lumps."""
        probe = load_probe(SIMULATED_PROBE)
        places = grid_places(PRESSES_A_SIDE, SPACING_MM)
        made = virtual_scan(probe, THREE_LUMPS, places, rng=np.random.default_rng(seed))
        folder = self.uploads.parent / SIMULATED
        shutil.rmtree(folder, ignore_errors=True)
        self.open(write_folder(folder, scan_files(made, probe=probe.name)))
        self.simulated = True

    def press_at(self, place_mm: tuple[float, float]) -> None:
        """Press the virtual probe at one place more of a simulated scan."""
        if self.source is None or not self.simulated:
            raise InputError("a simulated scan must be open for the virtual probe to press")
        probe, before = load_probe(SIMULATED_PROBE), read_scan(self.source).scan
        number = len(before.presses) + 1
        places = np.array([before.presses[-1].place_mm, place_mm])  # a scan has two places at least
        made = virtual_scan(probe, THREE_LUMPS, places, rng=np.random.default_rng(number))
        press = replace(made.presses[-1], name=f"press {number}")
        files = scan_files(replace(before, presses=(*before.presses, press)), probe=probe.name)
        for name in (f"press-{number:03d}.csv", POSES_FILE):  # the places last, as they name the presses
            write_durably(self.source / name, files[name])

    def version(self) -> int:
        """A number that changes when the scan's table or the target's presses do; 0 where there is none."""
        try:
            if self._target is not None:
                store, number = self._target
                return store.press_count(store.target(number))
            if self.source is None:
                return 0
            return (self.source / POSES_FILE if self.source.is_dir() else self.source).stat().st_mtime_ns
        except (OSError, TsisError):
            return 0

    def read(self, mm_per_pixel: tuple[float, float] | None, indenter: Indenter | None) -> StoredScan:
        """The scan as it lies on the disk now; errors as of `tsis.mapping.scan_folder.read_scan` and `target_scan`."""
        if (of_target := self.of_target()) is not None:
            return of_target.stored
        if self.source is None:
            raise InputError("a scan must be chosen first: drop its files, enter its folder, or open a target")
        return read_scan(self.source, mm_per_pixel=mm_per_pixel, indenter=indenter)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapQuestion:
    """A scan to be mapped.

    ``probe`` is a name of the catalog, empty for an indenter's travel and force; where ``tissue_known`` is false, the
    presses of an indenter tell the tissue's modulus. ``start`` is the map before the newest presses: then the answer
    guides to the next press, within seconds. The map of a target's scan is kept there too.
    """

    stored: StoredScan
    probe: str
    calibration: UsableCalibration | None
    prior: MapPrior
    tissue_known: bool = True
    start: LumpMap | None = None
    of_target: TargetScan | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapResult:
    """A map, its page with drawn pictures, and the name of its folder in the workspace; a guide is not kept.

    ``target`` is the number of the target that keeps it; None where none does.
    """

    found: LumpMap
    page: Page
    pictures: tuple[str, ...]
    name: str
    target: int | None = None


def map_of(
    question: MapQuestion, maps: MapRepository, draw: Callable[[Page], tuple[str, ...]]
) -> Callable[[Job], MapResult]:
    """The work of a job that maps a scan and keeps what is published of it; ``draw`` draws a page's pictures."""

    def work(job: Job) -> MapResult:
        scan, response = calibrated(question.stored.scan, question.calibration)
        prior = question.prior
        if not question.tissue_known:
            prior = suited_prior(scan, thickness_mm=prior.thickness_mm)
        found = estimate_map(
            scan,
            probe=load_probe(question.probe) if question.probe else None,
            calibration=response,
            prior=prior,
            progress=lambda done, total: job.advance(done, total + (total // DRAWN or 1)),
            start=question.start,
            steps=STEPS if question.start is None else GUIDE_STEPS,
            voxel_mm=VOXEL_MM,
            seed=SEED,
        )
        if question.start is not None:
            page = guide_page(found, title="Next place", subtitle=f"after {len(scan.presses)} presses")
            job.say(f"Updated by {len(scan.presses)} presses: map the lumps anew before you use a number.")
            return MapResult(found=found, page=page, pictures=draw(page), name="")
        citation = question.calibration.citation() if question.calibration else None
        report = map_report(found, scan, probe=question.probe, calibration=citation)
        files = {RESULT: json_bytes(report.document), PAGE: html_bytes(report.page), **report.volumes}
        if job.ending:
            raise JobCancelled
        name = maps.keep(scan.name or "scan", files)
        target = _kept(question, found, prior, name)
        kept = f"Kept as map {name}{'' if target is None else f' and in target {target}'}."
        job.say(kept if found.trusted else f"Withheld: a check failed. {kept}")
        return MapResult(found=found, page=report.page, pictures=draw(report.page), name=name, target=target)

    return work


def _kept(question: MapQuestion, found: LumpMap, prior: MapPrior, name: str) -> int | None:
    """Keep the map of a target's scan as its result, as the command does; the number of the target."""
    scan, usable = question.of_target, question.calibration
    if scan is None or usable is None:
        return None
    settings = {"voxel_mm": VOXEL_MM, "seed": SEED, "steps": STEPS, "left_out": scan.stored.scan.left_out}
    try:
        enter_map(
            scan.store,
            scan.target,
            found,
            presses=scan.presses,
            probe=question.probe,
            calibration=usable.calibration,
            options={"prior": asdict(prior), **settings},
        )
    except TsisError as error:
        raise RecordsError(f"the map is kept as map {name}, but not in target {scan.target.number}: {error}") from error
    return scan.target.number


class MapRepository:
    """The maps below a console's workspace, a folder each, as the command ``tsis map`` writes it."""

    def __init__(self, workspace: Path) -> None:
        self._folder = workspace / FOLDER

    def keep(self, name: str, files: dict[str, bytes]) -> str:
        """Write a map's files; the name of its folder, with a number where the name is taken."""
        plain = re.sub(r"[^A-Za-z0-9_-]+", "-", name, flags=re.ASCII).strip("-")[:60] or "scan"
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordsError(f"the folder of maps must be writable; got: {error.strerror or error}") from error
        return write_folder(free_folder(self._folder / plain), files).name

    def names(self) -> Sequence[str]:
        """Names of the maps, the newest first."""
        try:
            found = [(item.stat().st_mtime, item.name) for item in self._folder.iterdir() if (item / RESULT).is_file()]
        except FileNotFoundError:
            return ()
        except OSError as error:
            raise RecordsError(f"the folder of maps must be readable; got: {error.strerror or error}") from error
        return [name for _, name in sorted(found, reverse=True) if NAME.fullmatch(name)]

    def files(self, name: str) -> Sequence[str]:
        """Names of a map's files."""
        return sorted(item.name for item in self._path(name).iterdir() if item.is_file())

    def content(self, name: str, file: str) -> bytes:
        """One of a map's files; `AbsentError` when there is none."""
        if file not in self.files(name):
            raise AbsentError(f"file must be one of map {name!r}; got {file!r:.80}")
        return (self._path(name) / file).read_bytes()

    def _path(self, name: str) -> Path:
        if not NAME.fullmatch(name) or not (self._folder / name / RESULT).is_file():
            raise AbsentError(f"map must be one of this console's; there is none of the name {name!r:.80}")
        return self._folder / name
