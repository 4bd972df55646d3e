"""The calibration of a session, and the checks that light and force of its loadings agree."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import timedelta
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import VALID_DAYS
from tsis.calibration._measured import MeasuredValue
from tsis.calibration.dents import LEAST_PAD_N, PadPresses, fit_dent_light, ring_edges_mm
from tsis.calibration.file import ProbeCalibration
from tsis.calibration.force import UNTOUCHED_N, Loading, fit_force_line, fit_run, read_loading_frame, total_grey
from tsis.calibration.reference import make_reference
from tsis.calibration.response import fit_response
from tsis.calibration.scale import scale_from_dots
from tsis.calibration.session._setup import BOARD, BOARD_UNTOUCHED, DARK, EDGE, FLAT, UNTOUCHED
from tsis.calibration.specification import edge_width, frame_rate, specification_sheet
from tsis.catalog.probes import load_probe
from tsis.compiled import one_blas_thread
from tsis.errors import CalibrationError, ImageMismatchError, InputError
from tsis.files.reading import printable_path
from tsis.imaging import radial_profile
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from tsis.calibration.dents import DentLight
    from tsis.calibration.force import ForceLine, ForceLineDiagnostics
    from tsis.calibration.reference import CameraReference
    from tsis.calibration.response import PressureResponse
    from tsis.calibration.scale import DotDiagnostics, PixelScale
    from tsis.calibration.session._folder import CalibrationFrame, SessionFolder
    from tsis.calibration.session._setup import CalibrationStep, SessionSetup
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage


TOUCHED_N = 0.03  # above the zero: smaller forces are within the drift of an unloaded gauge
AT_REST = 0.02  # fraction of the largest sum of grey levels that a frame without contact may show
FEWEST_SEEN = 3  # presses on pads that compare the force line with the gauge
LEAST_CORRELATION = 0.97  # of sums and forces; loops of 10 % and curves as F**(2/3) have 0.99


def read_loading(shots: Sequence[CalibrationFrame], step: CalibrationStep, reference: CameraReference) -> Loading:
    """Read a loading without presses that are too light for the gauge to detect.

    Raises `CalibrationError` when a frame has no force or repeats the frame before, when the first frame shows contact,
    or when the sums do not follow the force.
    """
    assert step.tip_mm is not None
    forces = [shot.force_n for shot in shots]
    if any(force is None for force in forces):
        raise CalibrationError("every frame must have a force; one has none (is the gauge silent?)")
    _require_new_frames(shots)
    zero = float(forces[0] or 0.0)
    readings = []
    for shot in shots:
        load = float(shot.force_n or 0.0) - zero
        if abs(load) <= UNTOUCHED_N or load >= TOUCHED_N:
            reading = read_loading_frame(shot.image, reference, force_n=zero + load, touched=load >= TOUCHED_N)
            readings.append(reading)
    loading = Loading.from_frames(step.tip_mm, readings, run=step.run)
    first = float(loading.total_grey[0] / max(loading.total_grey.max(), 1.0))
    if first > AT_REST:
        raise CalibrationError(
            f"the tip must not touch in the first frame, whose force is the gauge's zero; it shows {first:.0%} of the "
            "largest sum of grey levels (repeat the step, and begin it untouched)"
        )
    _require_rising(loading)
    return loading


def require_measured_slope(line: ForceLine) -> None:
    """Refuse a force line whose slope is consistent with zero."""
    low, high = line.slope_grey_per_n.interval()
    if low <= 0:
        raise CalibrationError(
            f"the slope of the force line must differ from zero; its 95 % interval is {low:.3g} to {high:.3g} grey "
            "levels a newton, for the loadings disagree (repeat those that stand out, or load three tips or more)"
        )


def _require_new_frames(shots: Sequence[CalibrationFrame]) -> None:
    """Refuse repeated pictures: the noise of a live camera never repeats."""
    for number, (before, after) in enumerate(pairwise(shots), start=1):
        if np.array_equal(before.image.grey, after.image.grey):
            raise CalibrationError(
                f"every frame must be a new one; frames {number} and {number + 1} are identical (is the camera frozen? "
                "open it again, and repeat the step)"
            )


def _require_rising(loading: Loading) -> None:
    run = fit_run(loading)
    with np.errstate(invalid="ignore", divide="ignore"):  # undefined for equal sums
        correlation = float(np.corrcoef(run.force_n, run.total_grey)[0, 1])
    if not correlation >= LEAST_CORRELATION:
        raise CalibrationError(
            f"the sum of grey levels must rise with the force, correlated with it by {LEAST_CORRELATION:g} or more; "
            f"got {correlation:.2f} (do frames and forces belong together? repeat the step)"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionResult:
    """Diagnostics of a calibration, for the reader and for figures.

    Attributes
    ----------
    dots
        The dots of the board, and their residuals.
    board
        The frame of the board.
    loadings
        The loadings.
    line
        Diagnostics of the force line.
    response
        Gain and saturation with their intervals.
    dents
        Light on dents, where pads were pressed.
    """

    dots: DotDiagnostics
    board: TactileImage
    loadings: tuple[Loading, ...]
    line: ForceLineDiagnostics
    response: PressureResponse
    dents: DentLight | None = None


def calibrate(
    session: SessionFolder,
    *,
    days: float = VALID_DAYS,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[ProbeCalibration, SessionResult]:
    """Compute the calibration from the frames of a session; optional steps are used where they were done.

    Parameters
    ----------
    session
        With at least the dark, untouched, board and loading steps done.
    days
        Validity in days, in [1, 3650], from the start of the session, also when the file is computed again. A
        simulated calibration does not expire.
    progress
        Called with (steps done, steps in all).

    Raises
    ------
    CalibrationError
        When a step is missing, or its frames fail a check; the message names the step.
    FileInputError
        When a file of the session is missing or damaged.
    """
    require_number("days", days, 1, 3650)
    with one_blas_thread():  # sums of several threads depend on their number, and files are compared by their hash
        return _calibrated(session, days, progress)


def _calibrated(
    session: SessionFolder, days: float, progress: Callable[[int, int], None]
) -> tuple[ProbeCalibration, SessionResult]:
    terms, steps = session.terms(), {step.name: step for step in session.plan()}
    if missing := session.missing():
        raise CalibrationError(
            f"steps must be done first: {', '.join(missing)}; {printable_path(session.path)} lacks them"
        )
    still = [step for step in steps.values() if not step.is_loading]
    shots: dict[str, list[CalibrationFrame]] = {}
    for number, step in enumerate(still):
        if session.done(step):
            shots[step.name] = session.shots(step)
            _require_same_format(shots[step.name], step, shots[DARK][0].image)
        progress(number + 1, len(steps) + 1)
    board, untouched = _mean(shots[BOARD]), _mean(shots[BOARD_UNTOUCHED])
    with _named(BOARD):
        scale, dots = scale_from_dots(board, untouched, pitch_mm=terms.pitch_mm, pitch_sd_mm=terms.pitch_sd_mm)
    reference = _reference(shots, scale, terms.patch_px)
    loadings = []
    for step in steps.values():
        if step.tip_mm is not None:  # in turn, because the frames of a large camera fill the memory
            pressed = session.shots(step)
            _require_same_format(pressed, step, shots[DARK][0].image)
            with _named(step.name):
                loadings.append(read_loading(pressed, step, reference))
            progress(len(still) + len(loadings), len(steps) + 1)
    line, diagnostics = fit_force_line(loadings, reference=reference, gauge_fraction=terms.gauge_share)
    require_measured_slope(line)
    # The pitch has one error along both axes, so the relative errors of a pixel's sides add to that of its area.
    area = sum(size.sd / size.value for size in (scale.mm_per_pixel_x, scale.mm_per_pixel_y))
    response = fit_response(loadings, reference=reference, gauge_fraction=terms.gauge_share, area_fraction=area)
    by_tips = response.calibration(reference, name=terms.name, probe=terms.probe)
    dents, ratio = _dents(session, terms, by_tips, reference, loadings, line)
    line = replace(line, soft_ratio=ratio)
    times = [shot.time_s for shot in shots[UNTOUCHED] if shot.time_s is not None]
    calibration = ProbeCalibration(
        name=terms.name,
        probe=terms.probe,
        camera=terms.camera,
        settings=terms.settings,
        made=terms.began,
        expires=None if terms.began is None else terms.began + timedelta(days=days),
        scale=scale,
        reference=reference,
        force_line=line,
        response=by_tips,
        tissue=None if dents is None else dents.response,
        specification=specification_sheet(
            probe=terms.probe,
            line=line,
            diagnostics=diagnostics,
            edge_mm=_edge(shots, reference),
            frames_per_s=frame_rate(times) if len(times) == len(shots[UNTOUCHED]) else None,
        ),
    )
    progress(len(steps) + 1, len(steps) + 1)
    return calibration, SessionResult(
        dots=dots, board=board, loadings=tuple(loadings), line=diagnostics, response=response, dents=dents
    )


def _dents(
    session: SessionFolder,
    terms: SessionSetup,
    response: Calibration,
    reference: CameraReference,
    loadings: Sequence[Loading],
    line: ForceLine,
) -> tuple[DentLight | None, MeasuredValue | None]:
    """Light on dents from the pads that were pressed, and the force of the line over theirs; None without any."""
    pads = [step for step in session.plan() if step.pad_kpa is not None and session.done(step)]
    if not pads or reference.mm_per_pixel is None:
        return None, None
    probe, presses, ratios = load_probe(terms.probe), [], []
    for step in pads:
        with _named(step.name):
            shots = session.shots(step)
            presses.append(read_pad(shots, step, reference, ring_edges_mm(probe)))
            ratios += _line_over_gauge(shots, line, reference)
    pixel = reference.mm_per_pixel[0] * reference.mm_per_pixel[1]
    simulated = terms.began is None
    with _named(pads[0].name):
        dent_light = fit_dent_light(
            presses,
            loadings,
            probe=probe,
            response=response,
            pixel_mm2=pixel,
            pad_sd=terms.pad_sd,
            strain="small" if simulated else "finite",  # the virtual bench presses its pads at small strain
        )
    if len(ratios) < FEWEST_SEEN:
        return dent_light, None
    mean, sd = float(np.mean(ratios)), float(np.std(ratios, ddof=1))
    return dent_light, MeasuredValue(value=mean, sd=sd, degrees_of_freedom=len(ratios) - 1.0)


def _line_over_gauge(shots: Sequence[CalibrationFrame], line: ForceLine, reference: CameraReference) -> list[float]:
    """Force by the line of the tips over that of the gauge, for each press on a pad."""
    zero, result = float(shots[0].force_n or 0.0), []
    for shot in shots:
        if (force := float(shot.force_n or 0.0) - zero) >= LEAST_PAD_N:
            frame = replace(shot.image, mm_per_pixel=reference.mm_per_pixel)
            total = total_grey(frame, reference, method=line.method)
            if total > 0:  # at the exposure of the tips, pads may be too dark
                result.append((total - line.intercept_grey.value) / line.slope_grey_per_n.value / force)
    return result


def read_pad(
    shots: Sequence[CalibrationFrame], step: CalibrationStep, reference: CameraReference, edges_mm: NDArray[np.float64]
) -> PadPresses:
    """Read the rings of presses on a pad up to the largest force.

    Raises `CalibrationError` when a frame has no force or repeats the frame before.
    """
    assert step.pad_kpa is not None
    forces = [shot.force_n for shot in shots]
    if any(force is None for force in forces):
        raise CalibrationError("every frame must have a force; one has none (is the gauge silent?)")
    _require_new_frames(shots)
    load = np.array([float(force or 0.0) for force in forces])
    load -= load[0]
    rising = slice(0, int(load.argmax()) + 1)  # pads creep, and unloading shows it
    grey, variance = [], []
    for shot in shots[rising]:
        rings = radial_profile(
            reference.corrected(replace(shot.image, mm_per_pixel=reference.mm_per_pixel)), edges_mm=edges_mm
        )
        grey.append(np.where(rings.clipped_count > 0, np.nan, rings.mean_grey))
        pixel = (
            reference.read_noise_grey.value**2 + reference.shot_noise_grey.value * np.maximum(grey[-1], 0.0) + 1 / 12
        )
        variance.append(pixel / np.maximum(rings.count, 1))
    return PadPresses(
        young_kpa=step.pad_kpa, force_n=load[rising], grey=np.array(grey), variance=np.nan_to_num(np.array(variance))
    )


def _reference(
    shots: Mapping[str, Sequence[CalibrationFrame]], scale: PixelScale, patch_px: tuple[int, int, int, int] | None
) -> CameraReference:
    def scaled(name: str) -> list[TactileImage]:
        return [scale.on(shot.image) for shot in shots[name]]

    flats = [scaled(name) for name in sorted(shots) if name.startswith(f"{FLAT}-")]
    # Without flats, only the light beside the dot board shows the photon noise.
    scenes = [] if flats else [scaled(BOARD_UNTOUCHED)]
    return make_reference(scaled(DARK), scaled(UNTOUCHED), flats, patch_px=patch_px, scenes=scenes)


def _edge(shots: Mapping[str, Sequence[CalibrationFrame]], reference: CameraReference) -> MeasuredValue | None:
    if EDGE not in shots:
        return None
    with _named(EDGE):
        return edge_width(reference.corrected(replace(_mean(shots[EDGE]), mm_per_pixel=reference.mm_per_pixel)))


def _require_same_format(shots: Sequence[CalibrationFrame], step: CalibrationStep, first: TactileImage) -> None:
    expected = (first.grey.shape, first.full_scale)
    for shot in shots:
        got = (shot.image.grey.shape, shot.image.full_scale)
        if got != expected:
            raise ImageMismatchError(
                f"step {step.name!r}: frames must have the shape {expected[0]} and full scale {expected[1]:g} of step "
                f"{DARK!r}; got {got[0]} and {got[1]:g} (remove the step's folder and repeat it in that mode)"
            )


@contextmanager
def _named(step: str) -> Iterator[None]:
    """Prefix errors with the name of the step."""
    try:
        yield
    except (CalibrationError, InputError) as error:
        raise CalibrationError(f"step {step!r}: {error}") from error


def _mean(shots: Sequence[CalibrationFrame]) -> TactileImage:
    """The mean of frames of one scene."""
    return replace(shots[0].image, grey=np.mean([shot.image.grey for shot in shots], axis=0))
