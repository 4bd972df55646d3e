"""``tsis track``: movement of a press's light, and settling."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.cli.options import AsJson, ScaleMm, chosen_scale, typed_options
from tsis.cli.output import CommandOutcome, publish
from tsis.cli.progress import progress_bar
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.calibration.frames import UsableCalibration
    from tsis.model.image import TactileImage


MOST_FRAMES = 2000


def track(
    context: typer.Context,
    frames: Annotated[
        list[Path],
        typer.Argument(help="Frames of one press in the order of time, or the folder that tsis acquire recorded."),
    ],
    *,
    reference: Annotated[Path | None, typer.Option(help="Frame of the untouched probe to compare with.")] = None,
    reference_presses: Annotated[
        list[Path] | None,
        typer.Option(
            "--reference-press",
            help="Press on tissue without inclusion at the force of the frames, to compare with instead; repeatable.",
        ),
    ] = None,
    scale_mm: ScaleMm = None,
    interval_s: Annotated[
        float | None,
        typer.Option(help="Time from frame to frame in seconds; a recorded folder has its own times."),
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration file of the probe: its scale, and how unevenly the face is lit.")
    ] = None,
    threshold_grey: Annotated[
        float | None, typer.Option(help="Grey level above which a pixel counts as lit.", show_default="5 of 255")
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Remaining change of a settled press, relative to its settled value.")
    ] = 0.01,
    longest_s: Annotated[
        float | None, typer.Option(help="Longest time constant of the tissue to consider, seconds.", show_default="100")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("tsis-track"),
    as_json: AsJson = False,
) -> None:
    """Follow the light of a press through a sequence of frames, and report whether the press has settled."""
    if (reference is None) == (not reference_presses):
        raise InputError(
            "a sequence is compared with one kind of reference: give the untouched probe as --reference, or presses on "
            "tissue without inclusion as --reference-press"
        )
    usable = None if calibration is None else tsis.calibration.frames.load_calibration(calibration)
    scale = chosen_scale(usable, scale_mm)
    if scale is None:
        raise InputError("a movement needs --scale-mm, or a --calibration that contains the scale")
    paths, times = _sequence(frames, interval_s)
    if times is None and (unused := typed_options(context, ("tolerance", "longest_s"))):
        raise InputError(
            f"{' and '.join(unused)} must be given with times, by which a press settles: add --interval-s, or leave "
            f"{'them' if len(unused) > 1 else 'it'} out"
        )
    with progress_bar("reading frames") as advance:
        images = []
        for number, path in enumerate(paths):
            images.append(_read(path, scale, usable))
            advance(number + 1, len(paths))
    others = [
        _read(path, scale, usable) for path in (reference_presses or []) + ([] if reference is None else [reference])
    ]
    with progress_bar("following the light") as advance:
        result = tsis.inclusion.press_track.track_press(
            images,
            others,
            against="untouched probe" if reference is not None else "plain tissue",
            time_s=times,
            calibration=None if usable is None else usable.response,
            threshold_grey=threshold_grey,
            tolerance=tolerance,
            longest_s=tsis.calibration.settling.LONGEST_HOLD_S if longest_s is None else longest_s,
            progress=advance,
        )
    provenance: dict[str, Any] = {
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "images": [{"name": image.name, **image.settings} for image in images],
        "reference": [{"name": image.name, **image.settings} for image in others],
        "mm_per_pixel": list(scale),
        "calibration": None if usable is None else usable.citation(),
    }
    subtitle = f"{len(images)} frames, {images[0].name} to {images[-1].name}"
    outcome = CommandOutcome(
        document=tsis.present.document.envelope(
            "track", **tsis.present.tracking.track_document(result), provenance=provenance
        ),
        page=tsis.present.tracking.track_page(result, subtitle=subtitle, provenance=provenance),
    )
    publish(outcome, out, as_json=as_json)


def _sequence(frames: Sequence[Path], interval_s: float | None) -> tuple[list[Path], list[float] | None]:
    """Files of the frames, and their times where recorded."""
    if interval_s is not None:
        tsis.model.require.require_number("--interval-s", interval_s, 1e-4, 1e4, hint="seconds")
    times = None
    if len(frames) == 1 and frames[0].is_dir():
        index = tsis.instrument.recording.read_recording_index(frames[0])
        frames, times = [path for path, _ in index], [arrived_s for _, arrived_s in index]
        if interval_s is not None:
            raise InputError("--interval-s is not used with a recorded folder, which contains the times of its frames")
    elif interval_s is not None:
        times = [interval_s * number for number in range(len(frames))]
    if len(frames) > MOST_FRAMES:
        raise InputError(f"frames must be at most {MOST_FRAMES}; got {len(frames)}: give every second one, or fewer")
    return list(frames), times


def _read(path: Path, scale: tuple[float, float], calibration: UsableCalibration | None) -> TactileImage:
    """A frame, less the background level of the calibration if it has one."""
    image = tsis.instrument.image_files.read_image(path, mm_per_pixel=scale)
    return (
        image
        if calibration is None or calibration.calibration.reference is None
        else calibration.calibration.reference.corrected(image)
    )
