"""Size, depth and stiffness of an inclusion from the radial profile of one or more presses."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.inclusion.chart import SignalChart
from tsis.inclusion.forward import ForwardModel
from tsis.inclusion.frames import (
    as_frames,
    at_even_light,
    check_frames,
    ring_answers,
    ring_edges,
    ring_light,
    ring_profiles,
)
from tsis.inclusion.grid import Grid, refine
from tsis.inclusion.likelihood import Fit, Likelihood, Profiles
from tsis.inclusion.prior import PARAMETERS, InclusionPrior
from tsis.inclusion.verdict import verdict
from tsis.mechanics import build_surrogate
from tsis.model import Calibration, Estimate, Probe, TactileImage, check
from tsis.model.errors import InputError, NotCalibratedError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.mechanics import PressSurrogate

LINEARISATIONS = 2  # on a coarse grid, before that of the answer
COARSE, CELLS = 8, 16  # along each axis
SAMPLES = 16384


def estimate(
    images: TactileImage | Sequence[TactileImage],
    *,
    probe: Probe,
    calibration: Calibration,
    reference: TactileImage | Sequence[TactileImage] | None = None,
    prior: InclusionPrior | None = None,
) -> Estimate:
    """Estimate an inclusion under the probe's axis, with honest intervals.

    The posterior over diameter, depth and modulus follows from the ring means of the grey level. Gain, offset and
    force of each frame, the tissue's modulus and the slab's thickness are nuisances: unknown within their stated
    errors and integrated out.

    Parameters
    ----------
    images
        One or more presses on the same target as the camera delivered them, each with ``force_n`` and
        ``mm_per_pixel``.
    probe
        What pressed.
    calibration
        Answer of grey level to pressure and the sizes of the errors.
    reference
        Presses of the same probe on plain tissue nearby; they narrow size and depth.
    prior
        Ranges of the inclusion and beliefs about the tissue; `InclusionPrior` by default.

    Returns
    -------
    Estimate
        Of ``diameter_mm``, ``depth_mm`` and ``young_kpa``, with flags for what the data cannot tell.

    Raises
    ------
    InputError
        When there is no image, or one has no force or no scale, the probe's face lies outside the picture, or the face
        is domed: its pressure is not proportional to the force, which this estimate relies on.
    NotCalibratedError
        When no calibration is given.
    ImageMismatchError
        When the images differ in scale or range of values.
    """
    targets, references = as_frames("images", images), as_frames("reference", reference)
    if not targets:
        raise InputError("images must hold at least one TactileImage; got none")
    if not isinstance(calibration, Calibration):
        raise NotCalibratedError(
            f"calibration must be a Calibration, the answer of this probe's grey level to pressure; got {calibration!r}"
        )
    check.kind("probe", probe, Probe)
    if probe.face_curvature_mm is not None:
        raise InputError(
            f"probe must have a flat face for an estimate in this version; got face_curvature_mm "
            f"{probe.face_curvature_mm:g}, whose pressure is not proportional to the force"
        )
    prior = InclusionPrior() if prior is None else prior
    check.kind("prior", prior, InclusionPrior)
    check_frames(targets + references)
    surrogate = build_surrogate(probe, prior.box())
    with threadpool_limits(limits=1, user_api="blas"):  # matrices this small only lose time to threads
        likelihood, data = likelihood_of(
            targets, references, surrogate, probe=probe, calibration=calibration, prior=prior
        )
        samples, best = _posterior(likelihood, prior)
    even_targets, even_references = (
        [at_even_light(frame, calibration) for frame in frames] for frames in (targets, references)
    )
    flags, notes = verdict(samples, prior=prior, targets=even_targets, references=even_references, data=data, best=best)
    return Estimate(
        samples=dict(zip(PARAMETERS, samples.T, strict=True)),
        prior_sd=prior.sd,
        flags=flags,
        notes=notes,
        provenance=_provenance(probe, calibration, prior, targets, references, surrogate),
    )


def likelihood_of(
    targets: list[TactileImage],
    references: list[TactileImage],
    surrogate: PressSurrogate,
    *,
    probe: Probe,
    calibration: Calibration,
    prior: InclusionPrior,
) -> tuple[Likelihood, Profiles]:
    """Likelihood of inclusions given these frames, and the ring profiles that it rests on."""
    frames, edges = targets + references, ring_edges(probe)
    light = ring_light(frames[0], calibration, edges)
    data = ring_profiles(frames, calibration, edges, light=light.level, model_error=surrogate.error)
    model = ForwardModel(
        rings=ring_answers(surrogate, edges, light.level),
        level=light.level,
        shading=light.shading,
        calibration=calibration,
        prior=prior,
        force_n=np.array([frame.force_n for frame in frames]),
        is_reference=np.array([False] * len(targets) + [True] * len(references)),
    )
    return Likelihood(model, data), data


def _posterior(likelihood: Likelihood, prior: InclusionPrior) -> tuple[NDArray[np.float64], Fit]:
    """Samples (n, 3), and the fit at their mean; the nuisances are linearised anew twice."""
    chart = SignalChart(prior)

    def search(nuisance: NDArray[np.float64], per_axis: int) -> Grid:
        def density(points: NDArray[np.float64]) -> NDArray[np.float64]:
            return likelihood(chart.inclusions(points), nuisance).log_evidence + chart.log_volume(points)

        return refine(density, chart.low, chart.high, support=chart.allows, per_axis=per_axis)

    nuisance = likelihood.start
    for _ in range(LINEARISATIONS):
        coarse = search(nuisance, COARSE)
        nuisance = likelihood(chart.inclusions(coarse.mean()[None]), nuisance).nuisance[0]
    grid = search(nuisance, CELLS)
    best = likelihood(chart.inclusions(grid.mean()[None]), nuisance)
    return chart.inclusions(grid.samples(SAMPLES)), best


def _provenance(
    probe: Probe,
    calibration: Calibration,
    prior: InclusionPrior,
    targets: list[TactileImage],
    references: list[TactileImage],
    surrogate: PressSurrogate,
) -> dict[str, Any]:
    return {
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "method": "posterior of the radial profile, small strain, sphere on the axis",
        "probe": asdict(probe),
        "calibration": _describe_calibration(calibration),
        "prior": asdict(prior),
        "surrogate": surrogate.key,
        "images": [_describe(image) for image in targets],
        "reference": [_describe(image) for image in references],
    }


def _describe_calibration(calibration: Calibration) -> dict[str, Any]:
    """A calibration with the hash of its light instead of the map, which would be longer than all else."""
    light = None if calibration.light is None else calibration.light.sha256
    return asdict(replace(calibration, light=None)) | {"light": light}


def _describe(image: TactileImage) -> dict[str, Any]:
    return {
        "name": image.name,
        "sha256": hashlib.sha256(np.ascontiguousarray(image.grey).tobytes()).hexdigest(),
        "shape": list(image.grey.shape),
        "mm_per_pixel": list(image.scale()),
        "force_n": image.force_n,
        "settings": dict(image.settings),
    }
