"""Build the correction by finite strain: pairs of presses with and without contrast, each started from the last.

A low-discrepancy design fills the box, in the order of a short tour.
"""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.errors import MechanicsError
from tsis.files.cache import read_cached_arrays, remove_cached, write_cached_arrays
from tsis.mechanics.finite_strain.patches import NARROW, WIDE_LAYERS, FiniteResolution
from tsis.mechanics.mesh import hats, ring_points
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.surrogate.building import CHECKED_FRACTION, surrogate_key
from tsis.mechanics.surrogate.finite_correction import (
    CorrectionBox,
    CorrectionProcess,
    FiniteCorrection,
    correction_box,
    fit_lengths,
    left_out,
    wide_box,
)
from tsis.mechanics.surrogate.polynomial import Box, Degrees, chebyshev_points, contrast_from_factor, signal_scale
from tsis.mechanics.surrogate.states import FACE_POINTS, OUTPUTS, SlabPresses, design, narrow_mm, row_of_field
from tsis.model.press import MN_PER_N
from tsis.model.probe import Probe
from tsis.model.require import require_integer, require_type

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics.finite_strain.neo_hookean_press import PressContinuation, SolvedPress
    from tsis.mechanics.mesh import Floats


if TYPE_CHECKING:
    Progress = Callable[[int, int], None]


FORMAT_VERSION = 3
KIND = "finite-strain"
SAVED_EVERY = 20  # presses
PARTS = ("pairs", "checks")  # names of an unfinished build's presses
PRESSURE_MODES, DISPLACEMENT_MODES = 10, 6
LEADING_MODES = 4  # of the pressure and of the displacement: slow functions of the state
# First columns of what one process learns: multiples, logarithms of norms, leading modes, the other modes
GROUPS = [0, 2, 4, 4 + 2 * LEADING_MODES]
NORM = 2  # column of the pressure's logarithm of the norm
OF_PRESSURE = [0, *range(4, 4 + LEADING_MODES), *range(GROUPS[3], GROUPS[3] + PRESSURE_MODES - LEADING_MODES)]
MODES_FRACTION = 0.85  # of the face's radius, over which profiles are decomposed
RINGS = 20  # of the inner face, over which an estimate and the error take means
MOST_MISSING = 2  # presses without inclusion on one slab that need not converge
NARROWER = "narrow the prior to other contrasts, tissues or depths, or estimate with strain='small'"
EASY_SPHERE = (0.3, 0.2)  # diameter and depth of the sphere in the mesh of presses without inclusion, of the thickness


@dataclass(frozen=True, slots=True, kw_only=True)
class _Size:
    """Numbers of presses with and without contrast, to learn from and to measure the error, and of Chebyshev points."""

    pairs: int = 300
    checks: int = 30
    tissues: int = 4
    thicknesses: int = 3
    loads: int = 8


WIDE_SIZE = _Size(pairs=600, checks=60, tissues=7, thicknesses=4)


def build_finite_correction(
    probe: Probe,
    box: Box | None = None,
    *,
    seed: int = 1,
    pairs: int | None = None,
    checks: int | None = None,
    resolution: FiniteResolution | None = None,
    progress: Progress | None = None,
    cached: bool = True,
    ranges: CorrectionBox | None = None,
) -> FiniteCorrection:
    """Build what finite strain adds to the presses of a probe that cover its face, or load it from the disk cache.

    An interrupted build continues where it stopped; it takes one to four seconds a pair on one core.

    Parameters
    ----------
    probe, box
        The probe, and the inclusions and slabs that the correction covers; by default those of the default prior. The
        catalog's probes have tables for it.
    seed
        Seed of the design, in [0, 2**31).
    pairs, checks
        Number of presses with and without contrast to learn from, at least 20, and to measure the error; by default
        300 and 30, for tables of all tissues 600 and 60.
    resolution
        Mesh density of the finite-strain presses.
    progress
        Called with (presses solved, presses in all).
    cached
        Whether to read and write the disk cache.
    ranges
        Those of the correction, in place of those that cover ``box``.

    Raises
    ------
    InputError
        When a value lies outside its range.
    MechanicsError
        When more than a tenth of the presses do not converge.
    """
    require_type("probe", probe, Probe)
    seed = require_integer("seed", seed, 0, 2**31 - 1)
    ranges, poisson = ranges or correction_box(probe, box), 0.49 if box is None else box.poisson
    usual = WIDE_SIZE if ranges == wide_box(probe) else _Size()
    size = replace(
        usual,
        pairs=require_integer("pairs", usual.pairs if pairs is None else pairs, 20, 4096),
        checks=require_integer("checks", usual.checks if checks is None else checks, 1, 1024),
    )
    mesh = resolution or FiniteResolution()
    others = {
        "seed": seed,
        "size": asdict(size),
        "correction": asdict(ranges),
        "poisson": poisson,
        "modes": [PRESSURE_MODES, DISPLACEMENT_MODES],
        "small": asdict(Resolution()),
    }
    if narrow_mm(probe, ranges) < ranges.diameter_mm[1]:
        others["wide"] = [NARROW, WIDE_LAYERS]
    key = surrogate_key(FORMAT_VERSION, probe, Box(), Degrees(), mesh, others)
    arrays = read_cached_arrays(KIND, key) if cached else None
    if arrays is None:
        solver = SlabPresses.of(probe, ranges, poisson, mesh)
        with one_blas_thread():
            arrays = _solve(solver, seed, size, key if cached else None, progress)
        if cached:
            write_cached_arrays(KIND, key, arrays)
            for part in PARTS:
                remove_cached(KIND, f"{key}-{part}")
    return _loaded(probe, ranges, arrays, key)


def _loaded(probe: Probe, box: CorrectionBox, arrays: dict[str, Floats], key: str) -> FiniteCorrection:
    """A correction from the arrays on disk."""
    values = {name: np.asarray(array, dtype=float) for name, array in arrays.items()}
    modes = values["modes"]
    ends = np.append(GROUPS, values["coefficients"].shape[1])
    processes = tuple(
        CorrectionProcess.through(values["points"], values["coefficients"][:, start:end], row[:-1], float(row[-1]))
        for (start, end), row in zip(itertools.pairwise(ends.tolist()), values["lengths"], strict=True)
    )
    return FiniteCorrection(
        radius_mm=np.linspace(0.0, probe.radius_mm, FACE_POINTS),
        box=box,
        is_domed=probe.face_curvature_mm is not None,
        unit_force_n=values["unit_force_n"],
        baseline=values["baseline"],
        modes=modes,
        of_displacement=(np.any(modes[:, FACE_POINTS:], axis=1), np.arange(OUTPUTS) >= FACE_POINTS),
        processes=processes,
        left_out=values["left_out"],
        signal_error=(float(values["error"][0]), float(values["error"][1])),
        key=key,
    )


def _solve(
    solver: SlabPresses, seed: int, size: _Size, key: str | None, progress: Progress | None
) -> dict[str, Floats]:
    total = size.pairs + size.checks + size.tissues * size.thicknesses * size.loads
    solved = 0

    def advance() -> None:
        nonlocal solved
        solved += 1
        if progress is not None:
            progress(solved, total)

    unit_force, baseline = _without_inclusion(solver, size, advance)
    name = None if key is None else f"{key}-{PARTS[0]}"
    learnt = _pairs(solver, design(solver.box, size.pairs, seed), name, advance)
    modes, coefficients, points = _decomposed(solver.box, learnt)
    scaled = coefficients / coefficients.std(axis=0)
    fits = [fit_lengths(points, part) for part in np.split(scaled, GROUPS[1:], axis=1)]
    arrays: dict[str, Floats] = {
        "unit_force_n": unit_force,
        "baseline": baseline.astype("f4"),
        "modes": modes.astype("f4"),
        "points": points.astype("f4"),
        "coefficients": coefficients.astype("f4"),
        "lengths": np.array([np.append(*fit) for fit in fits]),
        "left_out": np.zeros(len(points), dtype="f4"),
        "error": np.zeros(2),
    }
    correction = _loaded(solver.probe, solver.box, arrays, "")
    arrays["left_out"] = _left_out(correction, learnt["states"], coefficients, fits).astype("f4")
    name = None if key is None else f"{key}-{PARTS[1]}"
    fresh = _pairs(solver, design(solver.box, size.checks, seed + 1), name, advance)
    return arrays | {"error": _measured(correction, fresh)}


def _without_inclusion(solver: SlabPresses, size: _Size, advance: Callable[[], None]) -> tuple[Floats, Floats]:
    """Log force of a unit load (tissue, thickness), and the correction (tissue, thickness, load, outputs)."""
    low, high = solver.box.coordinates
    tissues, thicknesses = (
        np.exp(chebyshev_points((float(low[i]), float(high[i])), count)).tolist()
        for i, count in ((3, size.tissues), (4, size.thicknesses))
    )
    grid = (size.tissues, size.thicknesses)
    unit, result = np.zeros(grid), np.zeros((*grid, size.loads, OUTPUTS))
    here: SolvedPress | None = None
    order = list(range(size.loads))
    for j, thickness in enumerate(thicknesses):
        widest = narrow_mm(solver.probe, solver.box)
        sphere = (min(EASY_SPHERE[0] * thickness, widest), EASY_SPHERE[1] * thickness)
        for i in range(size.tissues)[:: 1 if j % 2 == 0 else -1]:
            loads = chebyshev_points((solver.box.load[0], float(solver.box.largest_load(tissues[i]))), size.loads)
            without, _ = solver.small(tissues[i], thickness, None)
            force = solver.unit_force_n(tissues[i], without)
            unit[i, j] = np.log(force)
            for k in order:
                pressed = float(loads[k]) * force
                try:
                    here = solver.press(here, (tissues[i], thickness, pressed), sphere)
                except MechanicsError:  # tissue wraps around the rim near the largest loads
                    result[i, j, k] = np.nan
                else:
                    finite = row_of_field(here.result.field)[:OUTPUTS]
                    result[i, j, k] = finite - solver.at_force(without, pressed)
                advance()
            result[i, j] = _completed(loads, result[i, j])
            order.reverse()
    return unit, result


def _completed(loads: Floats, rows: Floats) -> Floats:
    """Rows (loads, outputs) with those of presses that did not converge from the polynomial through the others."""
    solved = np.isfinite(rows[:, 0])
    if solved.sum() < len(loads) - MOST_MISSING:
        raise MechanicsError(f"{(~solved).sum()} of {len(loads)} presses without inclusion do not converge: {NARROWER}")
    completed = rows.copy()
    completed[~solved] = scipy.interpolate.BarycentricInterpolator(loads[solved], rows[solved])(loads[~solved])
    return completed


def _pairs(solver: SlabPresses, states: Floats, name: str | None, advance: Callable[[], None]) -> dict[str, Floats]:
    """Signals of both models over their scale at the states that converge; an earlier build's are taken first."""
    arrays = None if name is None else read_cached_arrays(KIND, name)
    finished = {} if arrays is None else dict(zip(arrays["index"].tolist(), arrays["rows"], strict=True))
    failed = [] if arrays is None else arrays["failed"].tolist()
    latest: dict[PressContinuation, SolvedPress | None] = {}
    for index, (diameter, depth, factor, tissue, thickness, load) in enumerate(states.tolist()):
        if index not in finished and index not in failed:
            without, change = solver.small(tissue, thickness, (diameter, depth, factor))
            force = load * solver.unit_force_n(tissue, without)
            lines = solver.on(diameter)
            try:
                here = solver.press(latest.get(lines), (tissue, thickness, force), (diameter, depth))
                contrast = float(contrast_from_factor(factor))
                there = lines.follow(here, here.press.with_contrast(contrast))
                latest[lines] = here
            except MechanicsError as error:
                latest[lines] = None  # it may lie near the end of the model: start anew
                failed.append(index)
                if len(failed) > max(2, len(states) // 10):
                    raise MechanicsError(
                        f"more than a tenth of the presses of this box do not converge: {NARROWER}; the last: {error}"
                    ) from error
            else:
                signal = row_of_field(there.result.field) - row_of_field(here.result.field)
                scale = float(signal_scale(diameter, depth, factor))
                finished[index] = np.array([signal[:OUTPUTS] / scale, solver.at_force(change, force)])
            if name is not None and (index % SAVED_EVERY == 0 or index == len(states) - 1):
                saved = {"index": list(finished), "rows": list(finished.values()), "failed": failed}
                write_cached_arrays(KIND, name, {key: np.array(values) for key, values in saved.items()})
        advance()
    rows = np.array([finished[index] for index in sorted(finished)])
    return {"states": states[sorted(finished)], "finite": rows[:, 0], "small": rows[:, 1]}


def _decomposed(box: CorrectionBox, pairs: dict[str, Floats]) -> tuple[Floats, Floats, Floats]:
    """Modes (k, outputs), what the processes of a `FiniteCorrection` learn (n, 4 + k), and unit coordinates (n, 6)."""
    near = _ring_means(MODES_FRACTION)
    root = np.sqrt(np.arange(1, RINGS + 1))
    parts = []
    for first, count in ((0, PRESSURE_MODES), (FACE_POINTS, DISPLACEMENT_MODES)):
        small, finite = (pairs[strain][:, first : first + FACE_POINTS] for strain in ("small", "finite"))
        signal, change = ((profiles @ near.T) * root for profiles in (small, finite - small))
        norm = np.linalg.norm(signal, axis=1, keepdims=True)
        multiple = (signal * change).sum(axis=1, keepdims=True) / norm**2
        rest = (change - multiple * signal) / norm
        _, _, directions = np.linalg.svd(rest, full_matrices=False)
        coefficients = rest @ directions[:count].T
        # Profiles of the whole face that go with the coefficients.
        whole, *_ = np.linalg.lstsq(coefficients, (finite - small - multiple * small) / norm, rcond=None)
        padded = np.pad(whole, ((0, 0), (first, OUTPUTS - FACE_POINTS - first)))
        parts.append((multiple, np.log(norm), coefficients, padded))
    multiples, norms, values, modes = zip(*parts, strict=True)
    order = [slice(0, LEADING_MODES), slice(LEADING_MODES, None)]
    return (
        np.concatenate([profiles[rows] for rows in order for profiles in modes]),
        np.concatenate([*multiples, *norms, *(each[:, rows] for rows in order for each in values)], axis=1),
        box.unit(pairs["states"]),
    )


def _left_out(
    correction: FiniteCorrection, states: Floats, coefficients: Floats, fits: list[tuple[Floats, float]]
) -> Floats:
    """See `FiniteCorrection`; the modes are orthonormal over the rings, and what they leave out is neglected."""
    points = correction.box.unit(states)
    columns = np.split(coefficients, GROUPS[1:], axis=1)
    errors = np.hstack([left_out(points, part, *fit) for part, fit in zip(columns, fits, strict=True)])
    errors[:, NORM] *= np.linalg.norm(coefficients[:, OF_PRESSURE[1:]], axis=1)
    of_signal = np.linalg.norm(errors[:, [NORM, *OF_PRESSURE]], axis=1)
    rings = np.exp(coefficients[:, NORM]) / np.sqrt(np.arange(1, RINGS + 1).sum())
    signal = signal_scale(*states[:, :3].T) * rings
    forces_mn = MN_PER_N * np.array([_force_n(correction, *state) for state in states[:, 3:].tolist()])
    return np.asarray(of_signal * signal * np.pi * correction.radius_mm[-1] ** 2 / forces_mn)


def _force_n(correction: FiniteCorrection, tissue: float, thickness: float, load: float) -> float:
    most = float(correction.box.largest_load(np.array(tissue)))
    return load / most * correction.forces_n(tissue, thickness)[1]


def _ring_means(fraction: float) -> Floats:
    """Matrix from profiles to means over equally wide rings inside a fraction of the face's radius."""
    points, areas = ring_points(np.linspace(0.0, fraction, RINGS + 1))
    shape = (RINGS, len(points) // RINGS)
    weights = areas.reshape(shape) / areas.reshape(shape).sum(axis=1, keepdims=True)
    values = hats(np.linspace(0.0, 1.0, FACE_POINTS), points).reshape(*shape, -1)
    return np.asarray(np.einsum("rq,rqn->rn", weights, values))


def _measured(correction: FiniteCorrection, pairs: dict[str, Floats]) -> Floats:
    """Errors of fresh presses; see `FiniteCorrection`."""
    near = _ring_means(CHECKED_FRACTION)
    peaks = []
    for (diameter, depth, factor, tissue, thickness, load), finite, small in zip(
        pairs["states"].tolist(), pairs["finite"], pairs["small"], strict=True
    ):
        contrast = np.array([float(contrast_from_factor(factor))])
        state = np.array([[tissue, thickness, _force_n(correction, tissue, thickness, load)]])
        scale = float(signal_scale(diameter, depth, factor))
        sphere = (np.array([diameter]), np.array([depth]), contrast)
        (expected,) = correction.change(*sphere, state, scale * small[None, None])[0]
        error = near @ (expected - scale * (finite - small))[:FACE_POINTS]
        peaks.append(np.abs(error).max() / (scale * np.abs(near @ small[:FACE_POINTS]).max()))
    return np.array([np.median(peaks), np.max(peaks)])
