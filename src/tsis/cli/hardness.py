"""``tsis hardness``: Young's modulus of a touched object."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import CALIBRATION_FILE, LARGEST_SEED, RESEARCH_USE_ONLY, __version__
from tsis.cli.options import (
    AsJson,
    PriorFile,
    ScaleMm,
    ShowHardnessPrior,
    calibrated_probe,
    chosen_probe,
    chosen_scale,
    read_frames,
    require_no_file,
    target_forces,
    typed_options,
)
from tsis.cli.output import CommandOutcome, leave, print_json
from tsis.cli.progress import progress_bar, waiting
from tsis.cli.saving import (
    KindOption,
    SaveOption,
    StoreOption,
    TargetOption,
    chosen_destination,
    publish_and_save,
    save_estimate,
)
from tsis.cli.sensor import (
    chosen_sensor,
    gel_frame_forces,
    gel_frame_paths,
    gel_frame_times,
    read_gel_frame,
    read_gel_reference,
    untouched_of,
)
from tsis.errors import InputError
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.cli.saving import Destination
    from tsis.hardness.posterior import HardnessPrior
    from tsis.instrument.gauge import ForceReading
    from tsis.model.calibration import Calibration
    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


PANEL = "Contacts of a gel sensor"
ContactsFile = Annotated[
    Path | None,
    typer.Option(
        "--contacts",
        help="CSV file with force_n and radius_mm or area_mm2, or depth_mm; also *_sd_mm, force_sd_n.",
        rich_help_panel=PANEL,
    ),
]
ContactsSensor = Annotated[
    str | None,
    typer.Option("--sensor", help="Gel sensor of the contacts: a name, or mine.toml.", rich_help_panel=PANEL),
]
CylinderLength = Annotated[
    float | None,
    typer.Option("--cylinder-mm", help="Length of the contact of a cylinder on its side.", rich_help_panel=PANEL),
]
FlatObject = Annotated[bool, typer.Option("--flat", help="The object is flat.", rich_help_panel=PANEL)]
BallContacts = Annotated[
    Path | None,
    typer.Option("--ball-contacts", help="CSV file of contacts with a rigid ball.", rich_help_panel=PANEL),
]
OneSequence = Annotated[
    bool,
    typer.Option("--sequence", help="The contacts are one press in the order of time.", rich_help_panel=PANEL),
]
PressSd = Annotated[
    float,
    typer.Option("--press-sd", help="Relative sd of contact radii from press to press.", rich_help_panel=PANEL),
]
ForceZeroSd = Annotated[
    float,
    typer.Option("--force-zero-sd-n", help="Sd of the force's zero in N; 0 for a tared gauge.", rich_help_panel=PANEL),
]
ForceLagSd = Annotated[
    float,
    typer.Option(
        "--force-lag-sd-s",
        help="Sd of the time in s between force and image, where the table has time_s and press.",
        rich_help_panel=PANEL,
    ),
]
GaugeTable = Annotated[
    Path | None,
    typer.Option("--forces", help="Table of the gauge, time_s and force_n, beside a video.", rich_help_panel=PANEL),
]
UntouchedFrame = Annotated[
    Path | None,
    typer.Option("--reference", help="Frame of the untouched gel sensor; of a video its first.", rich_help_panel=PANEL),
]
VideoStart = Annotated[
    float,
    typer.Option("--video-start-s", help="Time of the video's first frame in that table.", rich_help_panel=PANEL),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactOptions:
    """What the command line says of contacts."""

    sensor: str | None
    force_n: list[float] | None
    radius_mm: float | None
    radius_sd_mm: float | None
    cylinder_mm: float | None
    flat: bool
    ball: Path | None
    ball_radius_mm: float | None
    sequence: bool
    press_sd: float
    force_zero_sd_n: float
    lag_sd_s: float
    reference: Path | None = None
    forces: Path | None = None
    video_start_s: float = 0.0


def contacts_of_frames(paths: Sequence[Path], given: ContactOptions) -> tuple[Any, ContactOptions]:
    """Contacts of frames or of a video of a gel sensor, with forces; and the options with the delay that was found."""
    if given.sensor is None:
        raise InputError("frames of a gel sensor need --sensor")
    chosen = chosen_sensor(given.sensor)
    frames = gel_frame_paths(paths)
    times = gel_frame_times(frames)
    readings = _gauge_readings(times, given)
    with progress_bar("finding contacts") as advance:
        found = tsis.imaging.gel_contact.contacts(
            [read_gel_frame(path) for path in frames],
            sensor=chosen,
            reference=read_gel_reference(chosen, given.reference or untouched_of(paths)),
            names=[path.name for path in frames],
            progress=advance,
        )
    if times is None:
        return (found, given) if given.force_n else (_with_forces(found, gel_frame_forces(frames)), given)
    film = tsis.hardness.film.filmed_press(found, [time + given.video_start_s for time in times], readings)
    for note in film.notes:
        typer.echo(note, err=True)
    lag_sd = given.lag_sd_s if film.lag_sd_s is None else film.lag_sd_s
    return film.contacts, replace(given, sequence=True, lag_sd_s=lag_sd)


def _with_forces(found: Sequence[Any], forces: Sequence[tuple[float | None, float | None]]) -> list[dict[str, Any]]:
    """The contacts with the force that stands beside each frame, if any, and its standard deviation."""
    names = (*tsis.hardness.contacts.COLUMNS, "name", "good")
    rows = [{name: tsis.hardness.contacts.contact_value(contact, name) for name in names} for contact in found]
    return [row | {"force_n": force, "force_sd_n": sd} for row, (force, sd) in zip(rows, forces, strict=True)]


def _gauge_readings(times: Sequence[float] | None, given: ContactOptions) -> list[ForceReading]:
    """The gauge's readings beside a video, checked before any frame is looked at; none for single frames."""
    if times is None:
        if given.forces is not None or given.video_start_s:
            raise InputError(
                "--forces and --video-start-s need a video: give the forces of single frames as --force-n, one for each"
            )
        return []
    if given.force_n:
        raise InputError("--force-n must be left out with a video: its forces are the gauge's (--forces)")
    if given.forces is None:
        raise InputError("a video needs --forces, the table of the gauge with time_s and force_n")
    gauge = tsis.instrument.gauge.RecordedGauge(given.forces)
    gauge.open()
    readings = list(gauge.readings())
    begin, end = (time + given.video_start_s for time in (times[0], times[-1]))
    first, last = (readings[at].time_s for at in (0, -1)) if readings else (0.0, 0.0)
    if not readings or end < first or begin > last:
        raise InputError(
            f"the gauge must have readings during the film, from {begin:.4g} to {end:.4g} s; they go from {first:.4g} "
            f"to {last:.4g} s: check the time of the film's first frame (--video-start-s)"
        )
    return readings


def hardness_from_contacts(path: Any, given: ContactOptions, *, prior: HardnessPrior | None, as_json: bool) -> None:
    """Estimate and print; the exit code is 3 where the result must not be trusted."""
    if given.sensor is None:
        raise InputError("--contacts needs --sensor, the gel sensor that was touched (tsis sensor show lists them)")
    if given.flat and given.cylinder_mm is not None:
        raise InputError("--flat and --cylinder-mm must not be given together: an object has one shape")
    shape = "flat" if given.flat else "sphere" if given.cylinder_mm is None else "cylinder"
    forces = given.force_n if given.force_n is None or len(given.force_n) > 1 else given.force_n[0]
    with waiting("estimating the modulus"):
        result = tsis.hardness.estimate_from_contacts(
            path,
            sensor=given.sensor,
            force=forces,
            geometry={
                "shape": shape,
                "radius_mm": given.radius_mm,
                "radius_sd_mm": given.radius_sd_mm,
                "length_mm": given.cylinder_mm,
            },
            reference=given.ball,
            reference_radius_mm=given.ball_radius_mm,
            prior=prior,
            sequence=given.sequence,
            press_sd=given.press_sd,
            force_zero_sd_n=given.force_zero_sd_n,
            lag_sd_s=given.lag_sd_s,
        )
    if as_json:
        withheld = result.withheld_reason("young_kpa")
        print_json(
            tsis.present.document.envelope(
                "hardness contacts",
                estimate=tsis.present.document.estimate_document(result, None),
                shore_converted=None if withheld else asdict(tsis.hardness.shore.shore(result.mean["young_kpa"])),
                provenance=dict(result.provenance),
            )
        )
    else:
        shown = tsis.present.hardness.hardness_table(result, title=f"Hardness by contacts of {given.sensor}")
        print_tables((shown,), tsis.present.hardness.hardness_notes(result))
    leave(trusted=result.trusted)


DEMO, DEMO_FORCES = "cl2000x", [0.7, 1.2]
UNNAMED = "tsis-direct"  # for calibrations that name no probe


KEPT = ("out", "save", "store", "kind", "number")  # no folder is written of contacts, and no record kept
OF_PROBE = ("scale_mm", "calibration", "ball", "ball_force_n", "probe", "virtual", "demo", "seed", *KEPT)
OF_CONTACTS = ("cylinder_mm", "flat", "ball_contacts", "sequence", "press_sd", "force_zero_sd_n", "force_lag_sd_s")
OF_FRAMES = ("forces", "reference", "video_start_s")  # of a gel sensor


def _require_options_that_count(context: typer.Context, *, contacts: bool, frames: bool, virtual: bool) -> None:
    """`InputError` for an option that the kind of presses would ignore."""
    if contacts or frames:
        what = "--contacts" if contacts else "frames of a gel sensor (--sensor)"
        ignored = typed_options(context, (*OF_PROBE, *(OF_FRAMES if contacts else ())))
    else:
        what = "--virtual and --demo" if virtual else "frames of a probe"
        ignored = typed_options(context, (*OF_CONTACTS, *OF_FRAMES, *(() if virtual else ("seed",))))
    if ignored:
        raise InputError(f"{' and '.join(ignored)} must be left out with {what}, for which it means nothing")


def hardness(
    context: typer.Context,
    images: Annotated[
        list[Path] | None,
        typer.Argument(help="Frames of the probe pressed on the object itself; or, with --sensor, frames or a video."),
    ] = None,
    *,
    force_n: Annotated[
        list[float] | None, typer.Option("--force-n", help="Force in newtons, one for each image.")
    ] = None,
    radius_mm: Annotated[float | None, typer.Option("--radius-mm", help="Radius of the object in millimetres.")] = None,
    radius_sd_mm: Annotated[
        float | None, typer.Option(help="Standard deviation of that radius.", show_default="0.03")
    ] = None,
    scale_mm: ScaleMm = None,
    calibration: Annotated[Path | None, typer.Option(help="Calibration file of the probe.")] = None,
    ball: Annotated[
        list[Path] | None, typer.Option(help="Press of a rigid ball with the same probe; repeat it for more.")
    ] = None,
    ball_force_n: Annotated[
        list[float] | None, typer.Option("--ball-force-n", help="Force of each of them, in their order.")
    ] = None,
    ball_radius_mm: Annotated[float | None, typer.Option(help="Radius of that ball.")] = None,
    probe: Annotated[
        str | None,
        typer.Option(
            help="Name in the catalog, or a file of your own, as mine.toml.",
            show_default=f"the calibration's, else {UNNAMED}",
        ),
    ] = None,
    virtual: Annotated[
        str | None, typer.Option(help="Press a virtual sphere of the catalog instead: cl2000x or cl2003x.")
    ] = None,
    demo: Annotated[bool, typer.Option("--demo", help=f"The same as --virtual {DEMO}.")] = False,
    contacts: ContactsFile = None,
    sensor: ContactsSensor = None,
    cylinder_mm: CylinderLength = None,
    flat: FlatObject = False,
    ball_contacts: BallContacts = None,
    sequence: OneSequence = False,
    press_sd: PressSd = 0.02,
    force_zero_sd_n: ForceZeroSd = 0.03,
    force_lag_sd_s: ForceLagSd = 0.1,
    forces: GaugeTable = None,
    reference: UntouchedFrame = None,
    video_start_s: VideoStart = 0.0,
    prior: PriorFile = None,
    show_prior: ShowHardnessPrior = False,
    seed: Annotated[int, typer.Option(help="Seed of the virtual rig's errors.", min=0, max=LARGEST_SEED)] = 1,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path(
        "tsis-hardness"
    ),
    save: SaveOption = False,
    store: StoreOption = None,
    kind: KindOption = None,
    number: TargetOption = None,
    as_json: AsJson = False,
) -> None:
    """Estimate Young's modulus of a touched object from two presses, with its interval and as Shore hardness.

    With --contacts the presses are those of a gel sensor, read by this or any other program. Frames or a video of a gel
    sensor, with --sensor, are read here: give --force-n for each frame, or --forces beside a video.
    """
    paths = images or []
    if contacts is not None or sensor is not None:
        if contacts is None and not paths:
            raise InputError("--sensor needs --contacts, or frames or a video of that gel sensor")
        if (contacts is not None and paths) or demo or virtual is not None or calibration is not None:
            raise InputError("--contacts must stand alone: give no images, calibration, --demo or --virtual")
        _require_options_that_count(context, contacts=contacts is not None, frames=contacts is None, virtual=False)
        own = (
            None if prior is None else tsis.catalog.priors.read_prior_file(prior, tsis.hardness.posterior.HardnessPrior)
        )
        stated = ContactOptions(
            sensor=sensor,
            force_n=force_n,
            radius_mm=radius_mm,
            radius_sd_mm=radius_sd_mm,
            cylinder_mm=cylinder_mm,
            flat=flat,
            ball=ball_contacts,
            ball_radius_mm=ball_radius_mm,
            sequence=sequence,
            press_sd=press_sd,
            force_zero_sd_n=force_zero_sd_n,
            lag_sd_s=force_lag_sd_s,
            reference=reference,
            forces=forces,
            video_start_s=video_start_s,
        )
        source: Any = contacts
        if contacts is None:
            source, stated = contacts_of_frames(paths, stated)
        hardness_from_contacts(source, stated, prior=own, as_json=as_json)
        return
    _require_options_that_count(context, contacts=False, frames=False, virtual=demo or virtual is not None)
    if save:
        require_no_file("--save", probe)
    assumed = (
        tsis.hardness.posterior.HardnessPrior()
        if prior is None
        else tsis.catalog.priors.read_prior_file(prior, tsis.hardness.posterior.HardnessPrior)
    )
    if demo or virtual is not None:
        typed = [*paths, *(ball or ()), calibration, scale_mm, radius_mm, radius_sd_mm, ball_radius_mm]
        if any(value is not None for value in typed):
            raise InputError("--virtual and --demo simulate the presses: give no images, scale, radius or calibration")
        chosen, name = chosen_probe(probe or UNNAMED), virtual or DEMO
        destination = chosen_destination(save, store, kind, number)
        _virtual(
            name, chosen, force_n or DEMO_FORCES, seed, out, prior=assumed, destination=destination, as_json=as_json
        )
        return
    if not paths:
        raise InputError("give the images of two presses, or --demo for a run without hardware")
    known = None if calibration is None else tsis.calibration.frames.load_calibration(calibration)
    scale = chosen_scale(known, scale_mm)
    if known is None or scale is None or not (force_n or known.calibration.force_line):
        raise InputError(
            "a hardness estimate needs --calibration, --scale-mm and --force-n for each image, the last two where the "
            "calibration contains neither scale nor force line"
        )
    newtons = target_forces(force_n, len(paths)) if force_n else [None] * len(paths)
    raw = read_frames(paths, newtons, scale)
    frames, response = known.pressed(raw)
    chosen = chosen_probe(probe) if probe else calibrated_probe(response.probe, unnamed=UNNAMED)
    balls = ball or []
    if len(ball_force_n or ()) != len(balls):
        raise InputError(f"--ball-force-n must be given once for each --ball; got it {len(ball_force_n or ())} times")
    raw_balls = read_frames(balls, ball_force_n or (), scale)
    if save:
        from tsis.records.importing import require_savable  # loads the libraries of records

        require_savable([*raw, *raw_balls])
    destination = chosen_destination(save, store, kind, number)
    options = {
        "radius_mm": radius_mm,
        "radius_sd_mm": radius_sd_mm,
        "reference": known.pressed(raw_balls)[0],
        "reference_radius_mm": ball_radius_mm,
        **_options(assumed),
    }
    outcome, result = _outcome(frames, chosen, response, options, cites=known.citation())
    keep = partial(
        save_estimate,
        kind="hardness",
        estimate=result,
        probe=chosen.name,
        calibration=known.calibration,
        frames={"target": raw, "ball": raw_balls},
        options=_written_down(options),
    )
    publish_and_save(outcome, out, destination, keep, as_json=as_json)


def _options(prior: HardnessPrior) -> dict[str, Any]:
    """Options of every estimate here, recorded so that another release can repeat it."""
    return {"prior": prior, "blur_mm": tsis.hardness.reading.BLUR_MM, "drift_sd": tsis.hardness.posterior.DRIFT_SD}


def _written_down(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options as stored: without the reference, which is stored as presses, and without those not given."""
    entries = {name: value for name, value in options.items() if name != "reference" and value is not None}
    return entries | {"prior": asdict(entries["prior"])}


def _virtual(
    name: str,
    probe: Probe,
    forces: Sequence[float],
    seed: int,
    out: Path,
    *,
    prior: HardnessPrior,
    destination: Destination | None,
    as_json: bool,
) -> None:
    import numpy as np

    sphere = tsis.catalog.phantoms.load_sphere(name)
    rig = tsis.virtual.direct_contact.DirectContactRig(probe, rng=np.random.default_rng(seed))
    with waiting(f"pressing {name} with the virtual rig"):
        frames = rig.press_path(sphere, forces_n=forces)
    simulated_probe = tsis.calibration.file.ProbeCalibration(
        name=rig.calibration.name, probe=probe.name, response=rig.calibration
    )
    files = {CALIBRATION_FILE: tsis.calibration.file.calibration_bytes(simulated_probe)}
    files |= {f"press-{frame.force_n:g}N.png": tsis.instrument.image_files.png_bytes(frame) for frame in frames}
    simulated = {"seed": seed, "sphere": asdict(sphere), "command": "tsis hardness"}
    options = _options(prior)
    outcome, result = _outcome(
        frames, probe, rig.calibration, options, truth_kpa=sphere.young_kpa, simulated=simulated, files=files
    )
    keep = partial(
        save_estimate,
        kind="hardness",
        estimate=result,
        probe=probe.name,
        calibration=simulated_probe,
        frames={"target": frames},
        options=_written_down(options),
        name=name,
        truth={"young_kpa": sphere.young_kpa},
    )
    publish_and_save(outcome, out, destination, keep, as_json=as_json)


def _outcome(
    frames: Sequence[TactileImage],
    probe: Probe,
    calibration: Calibration,
    options: dict[str, Any],
    *,
    truth_kpa: float | None = None,
    simulated: dict[str, Any] | None = None,
    files: dict[str, bytes] | None = None,
    cites: dict[str, Any] | None = None,
) -> tuple[CommandOutcome, Estimate]:
    with progress_bar("solving the contact of this probe (cached for next time)") as progress:
        result = tsis.hardness.estimate(frames, probe=probe, calibration=calibration, progress=progress, **options)
    title = f"Hardness by direct contact with {probe.name}"
    provenance = {"notice": RESEARCH_USE_ONLY, "tsis": __version__, "simulated": simulated, "calibration": cites}
    truth = None if truth_kpa is None else {"young_kpa": truth_kpa}
    withheld = result.withheld_reason("young_kpa")
    readings = None if withheld else asdict(tsis.hardness.shore.shore(result.mean["young_kpa"]))
    outcome = CommandOutcome(
        trusted=result.trusted,
        document=tsis.present.document.envelope(
            "hardness",
            estimate=tsis.present.document.estimate_document(result, truth),
            shore_converted=readings,
            provenance=provenance,
        ),
        page=tsis.present.hardness.hardness_page(
            result,
            title=title,
            images=frames,
            table=tsis.hardness.table.build_contact_table(probe),
            provenance=provenance,
            truth_kpa=truth_kpa,
        ),
        files=files or {},
    )
    return outcome, result
