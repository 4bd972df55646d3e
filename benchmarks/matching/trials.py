"""Trials of matching methods: the public ones, the hotel sequence, and generated ones."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from benchmarks.matching.distort import PUBLIC_LEVELS, SHAPES, Trial, distort, public_distortion, shuffled, visible

from tsis.errors import FileInputError, InputError
from tsis.files.reading import printable_path, read_bytes
from tsis.matching.methods import UNMATCHED
from tsis.model.require import require_array, require_integer, require_number, require_one_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from benchmarks.matching.distort import Family, Floats
    from numpy.typing import ArrayLike


DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "matching"
PUBLIC_FILE, SEQUENCE_FILE = "chui_rangarajan_trials1-70.npz", "cmum.mat"
# SciPy's compiled reader of MATLAB files ends the process on some damaged ones: it reads only this file.
SEQUENCE_SHA256 = "d428f3a01bee927dfeb71deaeb5229dbcf0cd2da07d3842e820a84f23ec50091"
LARGEST_BYTES = 64 * 2**20  # of a file, and of its decompressed content
PUBLIC_SHAPES = ("fish", "chinese")
FAMILIES: tuple[Family, ...] = tuple(PUBLIC_LEVELS)
# Of each family: its label, its field of `Distortion`, and its name in the public file.
_FAMILIES: dict[Family, tuple[str, str, str]] = {
    "deformation": ("degree of deformation", "bending", "def"),
    "noise": ("standard deviation of the noise", "noise_sd", "noise"),
    "outliers": ("outliers / points", "outlier_ratio", "outlier"),
    "rotation": ("rotation / degrees", "rotation_deg", "rot"),
    "occlusion": ("fraction occluded", "occluded", "occlusion"),
}
LEVEL_LABELS: dict[Family, tuple[str, tuple[float, ...]]] = {
    family: (label, tuple(getattr(item, name) for item in PUBLIC_LEVELS[family]))
    for family, (label, name, _) in _FAMILIES.items()
}
SEPARATIONS = tuple(range(10, 101, 10))  # frames
HIDDEN_FRACTIONS = (0.0, 0.1, 0.2, 0.3)  # of the landmarks of the first frame, which the second lacks
GENERATED_POINTS = 100


def matching_error(trial: Trial, transformed: ArrayLike) -> float:
    """Root-mean-square distance of the transformed source points, shape (n, d), from their true, noise-free targets.

    It is in the unit of the trial's points; points without a partner do not count. Raises `InputError` when
    ``transformed`` has another shape than the source, or is not finite.

    Examples
    --------
    >>> points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    >>> trial = Trial(source=points, target=points + 3, target_clean=points + 3, truth=np.arange(3))
    >>> matching_error(trial, points + [3.0, 0.0])
    3.0
    """
    transformed = require_array("transformed", transformed, ndim=2)
    if transformed.shape != trial.source.shape:
        raise InputError(f"moved must have the source's shape {trial.source.shape}; got {transformed.shape}")
    true = trial.truth != UNMATCHED
    away = transformed[true] - trial.target_clean[trial.truth[true]]
    return float(np.sqrt((away**2).sum(axis=1).mean()))


def public_trials(
    folder: Path, *, shape: str, family: Family, level: int, count: int | None = None, seed: int = 0
) -> Iterator[Trial]:
    """Trials of Chui and Rangarajan, with shuffled targets; the order in a trial does not depend on other trials.

    ``folder`` holds ``chui_rangarajan_trials1-70.npz``. The shape is ``"fish"`` (98 points) or ``"chinese"`` (105
    points), the ``level`` of the kind of distortion counts from 1, and ``count`` takes the first of the 70 trials, None
    all. The ``seed`` is that of the shuffling. Raises `InputError` when there is no such shape, family or level, or the
    file is missing or broken.
    """
    require_one_of("shape", shape, PUBLIC_SHAPES)
    public_distortion(family, level)
    key = f"{shape}_{_FAMILIES[family][2]}_{level}"
    stored = _public_arrays(folder / PUBLIC_FILE, (f"{key}_x1", f"{key}_target", f"{key}_target_clean"))
    models, targets = stored[f"{key}_x1"], stored[f"{key}_target"]
    cleans = stored.get(f"{key}_target_clean", targets)
    for number in range(len(targets))[:count]:
        model = models[number] if models.ndim == 3 else models
        rng = np.random.default_rng([seed, PUBLIC_SHAPES.index(shape), FAMILIES.index(family), level, number])
        truth = np.where(np.arange(len(model)) < targets.shape[1], np.arange(len(model)), UNMATCHED)
        yield shuffled(
            model, targets[number], cleans[number], truth, rng=rng, name=f"{shape}/{family}/{level}/{number}"
        )


def hotel_trials(
    folder: Path, *, separation: int, hidden: float = 0.0, count: int | None = None, seed: int = 0
) -> Iterator[Trial]:
    """Pairs of frames of the CMU hotel sequence, 30 landmarks each, in pixels, targets shuffled.

    ``folder`` holds ``cmum.mat``. The two lie ``separation`` frames apart, 1 to 100; the second lacks the fraction
    ``hidden`` of the landmarks of the first, at random, in [0, 0.9]. At most ``count`` pairs are spread evenly over the
    sequence, None takes all. Raises `InputError` when a value is out of range, or the file is missing or not the
    published one.
    """
    frames = _frames(folder / SEQUENCE_FILE, "hotel")
    require_integer("separation", separation, 1, len(frames) - 1)
    require_number("hidden", hidden, 0.0, 0.9)
    starts = np.arange(len(frames) - separation)
    if count is not None and count < len(starts):
        starts = np.unique(np.linspace(0, len(starts) - 1, count).round().astype(int))
    for start in starts.tolist():
        rng = np.random.default_rng([seed, separation, round(100 * hidden), start])
        first, second = frames[start], frames[start + separation]
        observed = visible(second, hidden, kind="scattered", rng=rng)
        truth = np.full(len(first), UNMATCHED)
        truth[observed] = np.arange(len(observed))
        name = f"hotel/hidden {hidden:g}/{separation}/{start}"
        yield shuffled(first, second[observed], second[observed], truth, rng=rng, name=name)


def generated_trials(
    *, shape: str, family: Family, level: int, count: int, seed: int = 0, points: int = GENERATED_POINTS
) -> Iterator[Trial]:
    """Trials like the public ones on generated shapes, each trial with a shape of its own of ``points`` points.

    ``shape`` is a name of `benchmarks.matching.distort.SHAPES`; ``family`` and ``level`` are those of `public_trials`.
    A trial does not depend on their number.
    """
    make = SHAPES[require_one_of("shape", shape, SHAPES)]
    distortion = public_distortion(family, level)
    for number in range(count):
        key = [seed, list(SHAPES).index(shape), FAMILIES.index(family), level, points, number]
        rng = np.random.default_rng(key)
        yield distort(make(points, rng=rng), distortion, rng=rng, name=f"{shape}/{family}/{level}/{number}")


def _public_arrays(path: Path, requested: tuple[str, ...]) -> dict[str, Floats]:
    """The requested arrays that the file contains."""
    if not path.is_file():
        raise FileInputError(f"{printable_path(path)} must be the file of the public trials; it does not exist")
    with np.load(path, allow_pickle=False) as stored:
        return {key: np.asarray(stored[key], dtype=float) for key in requested if key in stored}


def _frames(path: Path, name: str) -> Floats:
    """Landmarks of each frame, shape (frames, landmarks, 2)."""
    content = read_bytes(path, most=LARGEST_BYTES)
    result = hashlib.sha256(content).hexdigest()
    if result != SEQUENCE_SHA256:
        raise FileInputError(
            f"{printable_path(path)} must be {SEQUENCE_FILE} as its authors published it, "
            f"of SHA-256 {SEQUENCE_SHA256}; got one of {result}"
        )
    file: Any = io.BytesIO(content)
    stored: Any = scipy.io.loadmat(file, simplify_cells=True)
    frames = np.stack([np.asarray(frame, dtype=float) for frame in stored["CMUM"][name]["XTs"]])
    return frames if frames.shape[2] == 2 else np.asarray(frames.transpose(0, 2, 1))


GENERATED_SHAPES = ("curve", "strokes")
MOST_TRIALS = 10_000


def distorted_set(
    folder: Path | None,
    *,
    families: Sequence[Family] = FAMILIES,
    shapes: Sequence[str] | None = None,
    levels: Sequence[int] | None = None,
    count: int = 10,
    seed: int = 0,
) -> list[Trial]:
    """Trials of both shapes at every level of every kind of distortion.

    Without a ``folder`` of the public trials, trials of the same kinds are generated. The ``shapes`` are both public
    ones by default, or two generated ones; ``levels`` count from 1, and a kind without such a level omits it. There are
    ``count`` trials of each shape and level, of 70 public ones. Raises `InputError` when there is no such kind, shape
    or level, or the file is missing or broken.

    Examples
    --------
    >>> len(distorted_set(None, families=["noise"], levels=[1, 6], count=3))
    12
    """
    require_integer("count", count, 1, MOST_TRIALS)
    for family in families:
        require_one_of("family of trials", family, FAMILIES)
    if not families:
        raise InputError("families must name at least one kind of trials; got none")
    deepest = max(len(PUBLIC_LEVELS[family]) for family in families)
    for level in levels or ():
        require_integer("level", level, 1, deepest)
    chosen = shapes or (GENERATED_SHAPES if folder is None else PUBLIC_SHAPES)
    for shape in chosen:
        require_one_of("shape", shape, SHAPES if folder is None else PUBLIC_SHAPES)
    trials: list[Trial] = []
    for shape in dict.fromkeys(chosen):
        for family in dict.fromkeys(families):
            for level in range(1, len(PUBLIC_LEVELS[family]) + 1):
                if levels is not None and level not in levels:
                    continue
                if folder is None:
                    trials += generated_trials(shape=shape, family=family, level=level, count=count, seed=seed)
                else:
                    trials += public_trials(folder, shape=shape, family=family, level=level, count=count, seed=seed)
    return trials


def hotel_set(
    folder: Path,
    *,
    separations: Sequence[int] = SEPARATIONS,
    hidden: Sequence[float] = HIDDEN_FRACTIONS,
    count: int | None = None,
    seed: int = 0,
) -> list[Trial]:
    """The `hotel_trials` at every separation and fraction of hidden landmarks, at most ``count`` each."""
    if count is not None and count < 1:
        raise InputError(f"count must be at least 1; got {count}")
    return [
        trial
        for fraction in hidden
        for separation in separations
        for trial in hotel_trials(folder, separation=separation, hidden=fraction, count=count, seed=seed)
    ]
