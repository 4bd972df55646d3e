"""``tsis force``: newtons and pressure from a depth map of a gel sensor."""

from __future__ import annotations

import io
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

import tsis
from tsis.cli.options import AsJson
from tsis.cli.output import CommandResult, Out, show_result
from tsis.cli.progress import progress_bar, waiting
from tsis.cli.sensor import (
    GelReference,
    SensorOption,
    gel_frame_paths,
    gel_frame_times,
    read_gel_frame,
    read_gel_reference,
    required_reference,
    untouched_of,
)
from tsis.errors import FileInputError, InputError
from tsis.present.page import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.imaging.depth import DepthMap
    from tsis.mechanics.gel.force import DepthErrors, ForceScale, GelForce
    from tsis.mechanics.gel.shear import GelShear
    from tsis.model.gel_sensor import GelSensor


MOST_WEIGHTS = 10**6  # of a depth calibration
WEIGHT_DRAWS = 60  # of what a press of a known force may have
FRAME_DRAWS = 40  # of the interval, frame by frame
LARGEST_MAP = 16_000_000  # pixels
DEMO_FORCE_N, DEMO_RADIUS_MM = 0.4, 2.5
MODULUS_OF_STEEL_KPA = 1e5  # a thousand times the gel's is rigid


def force(
    depth: Annotated[
        Path | None,
        typer.Argument(
            help="Depth map: NPY file of rows and columns in mm, positive where the gel is pressed in; or with "
            "--calibration a frame or a video."
        ),
    ] = None,
    *,
    sensor: SensorOption = "gelsight-mini",
    weights: Annotated[
        list[str] | None,
        typer.Option(
            "--weight",
            help="Depth map of a press with a known force, as press.npy=0.5 (newtons); repeatable. It replaces what is "
            "not known of the gel.",
        ),
    ] = None,
    depth_scale_sd: Annotated[float, typer.Option(help="Relative error of the depth, one standard deviation.")] = 0.05,
    depth_offset_sd_mm: Annotated[float, typer.Option(help="Error of the depth's zero in mm.")] = 0.01,
    markers: Annotated[
        Path | None,
        typer.Option("--markers", help="Frame of the same press: the shift of its markers tells the shear force."),
    ] = None,
    reference: GelReference = None,
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", help="Depth calibration of the frame or video (tsis depth calibrate)."),
    ] = None,
    demo: Annotated[
        bool, typer.Option("--demo", help="Press a ball of 2.5 mm radius on the gel at 0.4 N by finite elements.")
    ] = False,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Compute the pressure and the normal force from a depth map of a gel sensor, with the force's interval."""
    if (depth is None) != demo:
        raise InputError("give one depth map as an NPY file, or --demo")
    _require_options_that_count(demo=demo, markers=markers, reference=reference, calibration=calibration)
    loaded = tsis.catalog.load_sensor(sensor)
    errors = tsis.mechanics.gel.force.DepthErrors(scale_sd=depth_scale_sd, offset_sd_mm=depth_offset_sd_mm)
    known = [_weight(text) for text in weights or []]
    if calibration is not None and depth is not None:
        _force_of_frames(depth, loaded, calibration, reference, errors, known, out, as_json=as_json)
        return
    with waiting("computing the pressure"):
        values = _demo_depth(loaded) if depth is None else _read_depth(depth)
        scale = _scale(known, loaded)
        result = tsis.mechanics.gel.force.gel_force(
            values, sensor=loaded, sd_mm=_read_sd(depth), errors=errors, scale=scale
        )
        shear = None if markers is None else _shear(markers, reference, loaded)
    low, high = result.interval_n()
    problems = (*result.problems, *(() if shear is None else shear.problems))
    document: dict[str, Any] = tsis.present.document.envelope(
        "force",
        sensor=loaded.name,
        depth=None if depth is None else str(depth),
        force_n=result.force_n,
        interval_n=[low, high],
        level=tsis.model.estimate.INTERVAL_LEVEL,
        peak_kpa=float(result.pressure_kpa.max()),
        contact_area_mm2=result.contact_area_mm2,
        deepest_mm=result.deepest_mm,
        strain_correction=result.strain_correction,
        scale=None if scale is None else {"factor": scale.factor, "relative_sd": scale.relative_sd},
        shear=None
        if shear is None
        else {"force_n": list(shear.force_n), "interval_n": shear.interval_n(), "explained": shear.explained},
        trusted=not problems,
    )
    rows = [
        ("normal force", f"{result.force_n:.3g} N"),
        ("90 % interval", f"{low:.3g} to {high:.3g} N"),
        ("highest pressure", f"{result.pressure_kpa.max():.3g} kPa"),
        ("contact", f"{result.contact_area_mm2:.3g} mm²"),
        ("deepest point", f"{result.deepest_mm:.3g} mm"),
    ]
    if shear is not None:
        for name, part, (left, right) in zip("xy", shear.force_n, shear.interval_n(), strict=True):
            rows.append((f"shear force along {name}", f"{part:.3g} N ({left:.3g} to {right:.3g} N)"))
    shown = CommandResult(
        document=document,
        tables=(Table(title="Force on the gel", columns=("quantity", "value"), values=tuple(rows)),),
        notes=(*problems, *(() if scale is not None else (_WIDE,))),
        figures={"pressure": lambda: _figure(values, result, loaded)},
        arrays={"pressure_kpa": result.pressure_kpa, "depth_mm": values},
    )
    show_result(shown, out, as_json=as_json, trusted=not problems)


def _require_options_that_count(
    *, demo: bool, markers: Path | None, reference: Path | None, calibration: Path | None
) -> None:
    """`InputError` for an option that would change nothing."""
    if demo and (calibration is not None or markers is not None):
        raise InputError("--demo must be given without --calibration and --markers: it has a depth map and no frame")
    if calibration is not None and markers is not None:
        raise InputError("--markers must be given with a depth map (NPY); with --calibration the depth is of frames")
    if reference is not None and calibration is None and markers is None:
        raise InputError("--reference must be given with --calibration or --markers: a depth map needs no reference")


def _scale(known: Sequence[tuple[Path, float]], sensor: GelSensor) -> ForceScale | None:
    """What the known weights tell of the gel; None without them."""
    if not known:
        return None
    maps = [_read_depth(path) for path, _ in known]
    for (first, (path, _)), (second, (other, _)) in combinations(enumerate(known), 2):
        if np.array_equal(maps[first], maps[second]):
            raise InputError(
                f"--weight must name each press once; {path.name} and {other.name} hold the same depth map"
            )
    presses = [
        tsis.mechanics.gel.force.gel_force(depth, sensor=sensor, sd_mm=_read_sd(path), draws=WEIGHT_DRAWS)
        for depth, (path, _) in zip(maps, known, strict=True)
    ]
    return tsis.mechanics.gel.force.gel_force_scale(presses, [newtons for _, newtons in known])


MOST_FORCES = 40  # frames of a video, evenly over it


def _force_of_frames(
    path: Path,
    sensor: GelSensor,
    calibration: Path,
    reference: Path | None,
    errors: DepthErrors,
    known: Sequence[tuple[Path, float]],
    out: Path | None,
    *,
    as_json: bool,
) -> None:
    """The force in each frame of a video, or in one frame, by its depth map."""
    document = tsis.files.reading.read_object(calibration, values=MOST_WEIGHTS)
    untouched = required_reference(sensor, reference or untouched_of([path]))
    mapper = tsis.imaging.depth.DepthMapper(tsis.imaging.depth.parse_depth_calibration(document), sensor, untouched)
    paths = gel_frame_paths([path])
    paths = paths[:: -(-len(paths) // MOST_FORCES)]
    seconds = gel_frame_times(paths)
    scale = _scale(known, sensor)
    rows: list[dict[str, Any]] = []
    problems: dict[str, None] = {}
    with progress_bar("computing forces") as advance:
        for number, frame in enumerate(paths, start=1):
            time = None if seconds is None else seconds[number - 1]
            depth = mapper.map(read_gel_frame(frame), name=frame.name)
            force = _pressed_force(depth, sensor, errors, scale)
            low, high = (0.0, 0.0) if force is None else force.interval_n()
            newtons, deepest = (0.0, 0.0) if force is None else (force.force_n, force.deepest_mm)
            found = (*depth.problems, *(() if force is None else force.problems))
            problems |= dict.fromkeys(found)
            rows.append(
                {"frame": frame.name, "time_s": time, "force_n": newtons, "interval_n": [low, high],
                 "deepest_mm": deepest, "trusted": not found}
            )  # fmt: skip
            advance(number, len(paths))
    peak = max(rows, key=lambda row: float(row["force_n"]))
    table = Table(
        title="Force on the gel, frame by frame",
        columns=("frame", "time / s", "force / N", "90 % interval / N", "deepest point / mm"),
        values=tuple(
            (
                row["frame"], "" if row["time_s"] is None else f"{row['time_s']:.2f}", f"{row['force_n']:.3g}",
                f"{row['interval_n'][0]:.3g} to {row['interval_n'][1]:.3g}", f"{row['deepest_mm']:.3g}",
            )
            for row in rows
        ),
    )  # fmt: skip
    shown = CommandResult(
        document=tsis.present.document.envelope(
            "force",
            "frames",
            sensor=sensor.name,
            frames=rows,
            peak_n=peak["force_n"],
            level=tsis.model.estimate.INTERVAL_LEVEL,
            trusted=bool(peak["trusted"]),
        ),
        tables=(table,),
        notes=(*problems, *(() if scale is not None else (_WIDE,))),
        figures={},
        arrays={},
    )
    show_result(shown, out, as_json=as_json, trusted=bool(peak["trusted"]))


def _pressed_force(
    depth: DepthMap, sensor: GelSensor, errors: DepthErrors, scale: ForceScale | None
) -> GelForce | None:
    """The force on a depth map; None where nothing is pressed in beyond the uncertainty."""
    module = tsis.mechanics.gel.force
    deepest = depth.depth_mm > module.CERTAIN * depth.sd_mm
    if not (deepest & (depth.depth_mm > module.SMALLEST_DEPTH_MM)).any():
        return None
    try:
        return module.gel_force(
            depth.depth_mm, sensor=sensor, sd_mm=depth.sd_mm, errors=errors, scale=scale, draws=FRAME_DRAWS
        )
    except InputError:  # nothing is left after the smoothing
        return None


_WIDE = "The gel's modulus passes one to one into the force: presses with known weights (--weight) narrow the interval."


def _shear(frame: Path, reference: Path | None, sensor: GelSensor) -> GelShear:
    """Shear force of a frame with markers; what speaks against its contact is a problem of the force.

    Raises `InputError` where there is no reference, or the contact has no radius in mm.
    """
    untouched = read_gel_reference(sensor, reference)
    if untouched is None:
        raise InputError("--markers needs a frame of the untouched sensor; give it as --reference")
    levels = read_gel_frame(frame)
    (contact,) = tsis.imaging.gel_contact.contacts([levels], sensor=sensor, reference=untouched, names=[frame.name])
    if contact.centre_mm is None or contact.radius_mm is None:
        raise InputError(f"the contact in {frame.name} must be found in mm for a shear force; got {contact.reasons}")
    moved = tsis.imaging.gel_contact.marker_shift(levels, untouched, sensor)
    shear = tsis.mechanics.gel.shear.gel_shear(
        moved.points_mm, moved.shift_mm, sensor=sensor, centre_mm=contact.centre_mm, radius_mm=contact.radius_mm
    )
    if contact.good:
        return shear
    problem = f"the contact in {frame.name} is not good: {', '.join(contact.reasons)}"
    return replace(shear, problems=(*shear.problems, problem))


def _read_depth(path: Path) -> NDArray[np.float64]:
    """A depth map of a file; `FileInputError` where the file holds none."""
    data = tsis.files.reading.read_bytes(path, most=16 * LARGEST_MAP)
    try:
        mapped = np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, EOFError):
        raise FileInputError(
            f"{path.name} must be an NPY file of a depth map, as tsis depth map writes it; got something else"
        ) from None
    if not isinstance(mapped, np.ndarray) or mapped.ndim != 2 or mapped.dtype.kind not in "fiu":
        raise FileInputError(
            f"{path.name} must hold numbers in rows and columns; got {getattr(mapped, 'shape', 'no array')}"
        )
    if mapped.size > LARGEST_MAP:
        raise FileInputError(f"{path.name} must have at most {LARGEST_MAP} pixels; got {mapped.size}")
    return np.asarray(mapped, dtype=float)


def _read_sd(depth: Path | None) -> NDArray[np.float64] | None:
    """The uncertainty that ``tsis depth`` wrote beside a depth map; None without it."""
    beside = None if depth is None else depth.with_name(f"{depth.stem}-sd.npy")
    return _read_depth(beside) if beside is not None and beside.is_file() else None


def _weight(text: str) -> tuple[Path, float]:
    path, _, newtons = text.rpartition("=")
    try:
        return Path(path), tsis.model.require.require_number("--weight", float(newtons), 1e-4, 1000.0, hint="newtons")
    except ValueError:
        raise InputError(f"--weight must be a depth map and its force, as press.npy=0.5; got {text!r:.80}") from None


def _demo_depth(sensor: GelSensor) -> NDArray[np.float64]:
    """Depth of the gel under a steel ball, at finite strain."""
    columns, rows = sensor.image_px
    pixel = sensor.scale_of(columns, rows)
    if pixel is None:
        raise InputError(f"--demo needs a sensor with mm_per_pixel; {sensor.name} has none")
    gel = tsis.Layer(
        thickness_mm=sensor.thickness_mm.best, young_kpa=sensor.young_kpa.best, poisson=min(sensor.poisson.best, 0.49)
    )
    probe = tsis.Probe(radius_mm=min(sensor.width_mm, sensor.height_mm) / 2, layers=(gel,), name=sensor.name)
    press = tsis.mechanics.finite_strain.soft_sphere.squeeze_sphere(
        probe,
        sphere_radius_mm=DEMO_RADIUS_MM,
        young_kpa=max(MODULUS_OF_STEEL_KPA, 100 * gel.young_kpa),
        poisson=0.3,
        force_n=DEMO_FORCE_N,
    )
    y, x = np.mgrid[:rows, :columns].astype(float)
    radius = np.hypot((x - (columns - 1) / 2) * pixel[0], (y - (rows - 1) / 2) * pixel[1])
    return np.asarray(np.interp(radius, press.field.radius_mm, press.field.face_displacement_mm))


def _figure(depth: NDArray[np.float64], result: GelForce, sensor: GelSensor) -> Figure:
    from matplotlib.figure import Figure  # slow to import

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    scale = sensor.scale_of(depth.shape[1], depth.shape[0])
    for ax, values, label in zip(
        figure.subplots(1, 2), (depth, result.pressure_kpa), ("depth / mm", "pressure / kPa"), strict=True
    ):
        image = tsis.TactileImage(grey=values, mm_per_pixel=scale, name=label)
        tsis.present.figures.tactile_image(image, ax, label=label)
    return figure
