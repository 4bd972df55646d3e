"""``tsis map``: lumps under an area, from presses at many places."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import CALIBRATION_FILE, LARGEST_SEED, LARGEST_TARGET
from tsis.cli.options import AsJson, ScaleMm, chosen_probe, chosen_scale, require_no_file
from tsis.cli.output import CommandOutcome
from tsis.cli.progress import progress_bar
from tsis.cli.saving import (
    PHANTOM,
    StoreDatabase,
    StoreFolder,
    StoreKind,
    chosen_destination,
    opened,
    publish_and_save,
    save_map,
)
from tsis.errors import InputError, TsisError

if TYPE_CHECKING:
    from tsis.calibration.frames import UsableCalibration
    from tsis.mapping.scan_folder import StoredScan
    from tsis.model.probe import Probe
    from tsis.records.values import TargetRecord


DEFAULT_PROBE = "tsis-2011"


def map_lumps(
    scan: Annotated[
        Path | None,
        typer.Argument(
            metavar="FOLDER|TABLE",
            help="A folder with poses.csv (file, x_mm, y_mm) beside its presses; or a table of an indenter: press, "
            "x_mm, y_mm, travel_mm, force_n.",
        ),
    ] = None,
    *,
    target: Annotated[
        int | None,
        typer.Option(
            help="In place of a folder: map the scan of this target of the store. With a folder and --save: keep the "
            "map under it.",
            min=1,
            max=LARGEST_TARGET,
        ),
    ] = None,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    probe: Annotated[
        str | None,
        typer.Option(
            help="Name in the catalog, or a file of your own.", show_default=f"that of poses.csv, else {DEFAULT_PROBE}"
        ),
    ] = None,
    calibration: Annotated[
        Path | None,
        typer.Option(help="Calibration file of the probe, for frames.", show_default="calibration.json of the folder"),
    ] = None,
    scale_mm: ScaleMm = None,
    ball_mm: Annotated[
        float | None, typer.Option(help="Radius of the ball that pressed, for travel and force.")
    ] = None,
    punch_mm: Annotated[
        float | None, typer.Option(help="Radius of the flat punch that pressed, for travel and force.")
    ] = None,
    tissue_kpa: Annotated[
        float | None,
        typer.Option(help="Modulus of the tissue.", show_default="5; of a table, the median press's with sd 0.3"),
    ] = None,
    tissue_sd: Annotated[
        float | None, typer.Option(help="Relative standard deviation of that modulus.", show_default="0.1")
    ] = None,
    thickness_mm: Annotated[float, typer.Option(help="Thickness of the tissue on its support.")] = 30.0,
    strain: Annotated[
        str, typer.Option(help="Mechanics of the model: small, or finite, which corrects deep presses of a probe.")
    ] = "small",
    voxel_mm: Annotated[float, typer.Option(help="Width of the map's voxels.", min=0.5, max=10.0)] = 2.0,
    steps: Annotated[int, typer.Option(help="Steps of the sampler.", min=1000, max=10_000_000)] = 20_000,
    seed: Annotated[int, typer.Option(help="Seed of the sampler.", min=0, max=LARGEST_SEED)] = 0,
    resume: Annotated[
        Path | None, typer.Option(help="File in which an interrupted estimate goes on; it is written meanwhile.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("tsis-map"),
    save: Annotated[
        bool,
        typer.Option("--save", help="Save frames with their places, calibration and map in the store: tsis records."),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Map several lumps in three dimensions, each with intervals, and what the scan could not have seen.

    The folder gets a page, result.json, map.vti for ParaView or 3D Slicer, and NIfTI and DICOM files where the extras
    map and dicom are installed.
    """
    if (scan is None) == (target is None) and not (save and scan):
        raise InputError("a scan must be given as a folder or a table, or by --target, and not by both without --save")
    if save:
        require_no_file("--save", probe)
    elif scan is not None:
        chosen_destination(False, store)
    if scan is None and (ball_mm, punch_mm, scale_mm) != (None, None, None):
        raise InputError("--ball-mm, --punch-mm and --scale-mm are of a folder or table; a target has frames and scale")
    source, record = Path(scan or ""), None
    if scan is None:
        record, stored, usable = _of_store(target or 0, store, kind, database)
        usable = usable if calibration is None else tsis.calibration.frames.load_calibration(calibration)
    else:
        usable = _calibration(source, calibration)
        stored = tsis.mapping.scan_folder.read_scan(
            source, mm_per_pixel=chosen_scale(usable, scale_mm), indenter=_indenter(ball_mm, punch_mm)
        )
    if stored.scan.kind == "frame" and usable is None:
        raise InputError("frames need --calibration, the calibration file of the probe that pressed")
    pressed, response = tsis.mapping.scan_folder.calibrated(stored.scan, usable)
    prior = tsis.mapping.stiffness.suited_prior(
        pressed, tissue_young_kpa=tissue_kpa, tissue_young_sd=tissue_sd, thickness_mm=thickness_mm
    )
    chosen = _probe(stored, probe)
    kept: dict[str, Any] = {}
    destination = None
    if save:
        kept = _kept(source, record, stored, chosen, usable, chosen_scale(usable, scale_mm))
        destination = chosen_destination(True, store, kind, target, database=database)
    with progress_bar(f"mapping {len(pressed.presses)} presses") as advance:
        found = tsis.mapping.estimate_map(
            pressed,
            probe=chosen,
            calibration=response,
            prior=prior,
            strain=strain,
            voxel_mm=voxel_mm,
            seed=seed,
            steps=steps,
            progress=advance,
            resume=resume,
        )
    report = tsis.present.lump_map.map_report(
        found,
        pressed,
        probe="" if chosen is None else chosen.name,
        calibration=None if usable is None else usable.citation(),
    )
    outcome = CommandOutcome(document=report.document, page=report.page, files=report.volumes, trusted=found.trusted)
    options = {
        "prior": asdict(prior),
        "strain": strain,
        "voxel_mm": voxel_mm,
        "seed": seed,
        "steps": steps,
        "left_out": pressed.left_out,
    }
    keep = partial(save_map, found=found, options=options, **kept)
    publish_and_save(outcome, out, destination, keep, as_json=as_json)


def _kept(
    folder: Path,
    record: TargetRecord | None,
    stored: StoredScan,
    probe: Probe | None,
    usable: UsableCalibration | None,
    scale: tuple[float, float] | None,
) -> dict[str, Any]:
    """What is kept beside a map: the presses of the target that was mapped, else the frames of the folder."""
    if stored.scan.kind != "frame" or probe is None or usable is None:
        raise InputError(
            "--save needs a scan of frames; pressures and forces stay in their folder: leave --save out, and keep the "
            "folder that the map is written to"
        )
    known: dict[str, Any] = {"probe": probe.name, "calibration": usable.calibration}
    if record is not None:
        return known | {"scan": tsis.records.places.placed_presses(record)}
    from tsis.records.sources import ImportOptions, scanned  # loads the libraries of records

    given = ImportOptions(mm_per_pixel=None if usable.calibration.scale else scale, **known)
    return known | {"scan": scanned(folder, given, lambda: None)}


def _of_store(
    number: int, folder: Path | None, kind: str, database: str | None
) -> tuple[TargetRecord, StoredScan, UsableCalibration | None]:
    """A target with its scan, and the calibration that its presses cite."""
    with opened(folder, kind, database) as records:
        record = records.record(records.target(number))
        stored = tsis.records.places.recorded_scan(record)
    return record, stored, tsis.records.places.recorded_calibration(record)


def _calibration(scan: Path, given: Path | None) -> UsableCalibration | None:
    beside = scan / CALIBRATION_FILE
    if given is None and not beside.is_file():
        return None
    return tsis.calibration.frames.load_calibration(given or beside)


def _indenter(ball_mm: float | None, punch_mm: float | None) -> tsis.mapping.scan.Indenter | None:
    if ball_mm is not None and punch_mm is not None:
        raise InputError("--ball-mm and --punch-mm must not be given together: one indenter pressed")
    if ball_mm is None and punch_mm is None:
        return None
    if ball_mm is None:
        return tsis.mapping.scan.Indenter(shape="punch", radius_mm=punch_mm or 0.0)
    return tsis.mapping.scan.Indenter(shape="ball", radius_mm=ball_mm)


def _probe(stored: StoredScan, given: str | None) -> Probe | None:
    if stored.scan.kind == "travel_force":
        if given is not None:
            raise InputError("--probe is not used with travel and force; leave it out")
        return None
    try:
        return chosen_probe(given or stored.probe or DEFAULT_PROBE)
    except TsisError as error:
        if given or not stored.probe:
            raise
        raise InputError(f"{error} (column probe of {tsis.mapping.scan_folder.POSES_FILE})") from error
