"""Errors of places as noise along what a press would change beside its place.

A press whose place errs by s reads ``T(p + s)`` of the tissue's total change T, lumps and unevenness together. All
presses tell T well enough for its derivatives at each place, whatever it is made of. For s of the standard deviation a
along both axes, ``T + s_x T_x + s_y T_y + (s_x^2 T_xx + 2 s_x s_y T_xy + s_y^2 T_yy) / 2`` has the mean
``T + a^2 (T_xx + T_yy) / 2`` and the covariance ``a^2 (T_x T_x' + T_y T_y') + a^4 (T_xx T_xx' / 2 + T_xy T_xy' +
T_yy T_yy' / 2)``. The derivatives are taken once more at the most probable places, where the second order has only the
errors that the presses leave. Lumps and unevenness are judged by the same noise, so that neither explains errors of
places which the other could not.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.compiled import one_blas_thread
from tsis.mapping.answers import SAME_LUMP_MM
from tsis.mapping.posterior import own_signal_variance

if TYPE_CHECKING:
    from tsis.mapping.observation import Observation
    from tsis.mapping.posterior import BlockLikelihood, FieldKind, Fit, Samples
    from tsis.mapping.signals import Floats

PLACE_MATTERS_MM = 0.05  # standard deviation of a place from which its error counts
LEAST_STEP_MM, LARGEST_STEP_MM = 0.3, 2.0  # of differences; between them the standard deviation
BESIDE = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1))  # steps
SLOPE_MM = 0.2  # step of the slopes of one lump
LEAST_STATES = 10  # with a lump whose place is spread
UNTOLD = 1e-9  # 1/mm², information on a lump's place of a press that does not show it
EXACT_MM = 1e-3  # of places whose error is noise


def with_place_errors(
    observation: Observation, likelihood: BlockLikelihood, lumps: Floats, slopes: Floats | None = None
) -> tuple[Observation, Floats]:
    """The presses with the errors of their places as noise.

    Parameters
    ----------
    observation
        The presses.
    likelihood
        Of these presses, with or without the errors of their places as noise.
    lumps
        The most probable lumps by that likelihood, (n, `LUMP_COLUMNS`).
    slopes
        What an earlier call gave with the presses of the likelihood. The derivatives are taken at the most probable
        places then, and what is of second order has the errors that are left of them.

    Returns
    -------
    The presses, and the derivatives of each by x and y over the error of its place, (presses, 2, numbers).
    """
    seen, kind, sd, weighted = _explained(likelihood, lumps)
    shift, left = np.zeros((len(seen.values), 2)), np.ones((len(seen.values), 1))
    if slopes is not None:
        shift = _shifts(observation, slopes, weighted)
        left = _left(likelihood, kind, sd, slopes)[:, None]
    step = np.clip(observation.place_sd_mm, LEAST_STEP_MM, LARGEST_STEP_MM)[:, None]
    moved = [observation.places_mm + shift + step * np.array(by) for by in BESIDE]
    fields = likelihood.field_at(kind, moved, weighted)
    here, right, leftward, up, down, first_corner, second_corner, third_corner, fourth_corner = (
        sd**2 * field + seen.table.signals(lumps, places, seen.angle, seen.force_n)
        for field, places in zip(fields, moved, strict=True)
    )
    size = np.where(observation.place_sd_mm > PLACE_MATTERS_MM, observation.place_sd_mm, 0.0)[:, None] / step
    first = np.stack([right - leftward, up - down], axis=1) * size[..., None] / 2
    size = size * left
    along = [(one - 2 * here + other) * size**2 for one, other in ((right, leftward), (up, down))]
    across = (first_corner + second_corner - third_corner - fourth_corner) * size**2 / 4
    second = np.stack([along[0] / np.sqrt(2), along[1] / np.sqrt(2), across], axis=1)
    return (
        replace(
            observation,
            values=observation.values
            - (along[0] + along[1]) / 2
            + np.einsum("pa,pan->pn", shift / observation.place_sd_mm[:, None], first),
            own=observation.own + first.swapaxes(1, 2) @ first + second.swapaxes(1, 2) @ second,
            places_mm=observation.places_mm + shift,
            place_sd_mm=np.where(size[:, 0] > 0, EXACT_MM, observation.place_sd_mm),
        ),
        first,
    )


def shifts(observation: Observation, likelihood: BlockLikelihood, lumps: Floats, slopes: Floats) -> Floats:
    """Posterior mean of the errors of places to first order in mm, (presses, 2): ``a G' C^-1 r`` with G, ``slopes``."""
    return _shifts(observation, slopes, _explained(likelihood, lumps)[3])


def with_place_spread(
    samples: Samples, observation: Observation, likelihood: BlockLikelihood, fit: Fit, rng: np.random.Generator
) -> Samples:
    """The states with each lump as uncertain along the skin as places that err leave it.

    Errors of the places move a lump that is known well in every press by their mean, of the variance ``a^2 / n`` for n
    presses near. Linear noise holds them as long as its slopes do: those of a lump that is far above the noise are not
    known well enough for errors of 2 mm, and what they miss would make its place too certain. With Q of a press, the
    information on a lump's place, the covariance by errors of places is ``(sum (Q^-1 + a^2)^-1)^-1`` less the same
    without a. Where the states have less, normal errors make up the rest.

    Parameters
    ----------
    samples, fit
        The states and the most probable one.
    observation, likelihood
        The presses before errors of their places became noise, and the likelihood that holds it.
    rng
        Draws the errors.
    """
    counts = [len(lumps) for lumps in samples.lumps]
    rows = np.concatenate(samples.lumps)
    for lump in fit.lumps:
        inside, middle = np.zeros(len(rows), dtype=bool), lump[:3]
        for _ in range(3):
            inside = np.linalg.norm(rows[:, :3] - middle, axis=1) < SAME_LUMP_MM
            if inside.sum() < LEAST_STATES:
                break
            middle = np.median(rows[inside, :3], axis=0)
        if inside.sum() >= LEAST_STATES:
            due = _variance_by_places(lump, observation, likelihood, fit)
            lacking, along = np.linalg.eigh(due - np.cov(rows[inside, :2].T))
            root = along * np.sqrt(np.maximum(lacking, 0.0))
            rows[inside, :2] += rng.standard_normal((int(inside.sum()), 2)) @ root.T
    return replace(samples, lumps=tuple(np.split(rows, np.cumsum(counts)[:-1])))


def _variance_by_places(lump: Floats, observation: Observation, likelihood: BlockLikelihood, fit: Fit) -> Floats:
    """Covariance of a lump's place along the skin by errors of the presses' places, (2, 2)."""
    seen, sd = observation, float(likelihood.sds[fit.sd])
    alone, right, left, up, down = (
        seen.table.signals(lump[None], likelihood.observation.places_mm + np.array(by), seen.angle, seen.force_n)
        for by in ((0.0, 0.0), (SLOPE_MM, 0.0), (-SLOPE_MM, 0.0), (0.0, SLOPE_MM), (0.0, -SLOPE_MM))
    )
    slopes = np.stack([right - left, up - down], axis=1) / (2 * SLOPE_MM)
    length, angle = likelihood.kinds[fit.kind].length_mm, np.zeros(1)
    noise = seen.own + sd**2 * seen.field.covariance(length, np.zeros((1, 2)), angle, seen.force_n[:1], angle)
    noise[:, range(noise.shape[1]), range(noise.shape[1])] += own_signal_variance(alone, sd)
    told = slopes @ np.linalg.solve(noise, slopes.swapaxes(1, 2)) + UNTOLD * np.eye(2)
    errs = seen.place_sd_mm[:, None, None] ** 2 * np.eye(2)
    return np.asarray(
        np.linalg.inv(np.linalg.inv(np.linalg.inv(told) + errs).sum(axis=0)) - np.linalg.inv(told.sum(axis=0))
    )


def _shifts(observation: Observation, slopes: Floats, weighted: Floats) -> Floats:
    return np.asarray(observation.place_sd_mm[:, None] * np.einsum("pan,pn->pa", slopes, weighted))


def _left(likelihood: BlockLikelihood, kind: FieldKind, sd: float, slopes: Floats) -> Floats:
    """Errors of places that the presses leave, over those before: root mean of ``1 - G' C^-1 G`` of both axes."""
    presses, _, count = slopes.shape
    precision = 1 / (1 + sd**2 * kind.size)
    left = np.empty(presses)
    with one_blas_thread():
        for press in range(presses):
            turned = kind.turn[:, press * count : (press + 1) * count] @ slopes[press].T
            left[press] = 1 - (turned**2 * precision[:, None]).sum() / 2
    return np.sqrt(np.clip(left, 0.05, 1.0))


def _explained(likelihood: BlockLikelihood, lumps: Floats) -> tuple[Observation, FieldKind, float, Floats]:
    """The presses, the most probable kind of field and its standard deviation, and the residual over its covariance."""
    seen = likelihood.observation
    residual = seen.values - likelihood.signal(lumps)
    weights = likelihood.log_weights(residual)
    number, at = (int(part) for part in np.unravel_index(weights.argmax(), weights.shape))
    kind, sd = likelihood.kinds[number], float(likelihood.sds[at])
    with one_blas_thread():
        turned = kind.turn @ residual.ravel()
        weighted = kind.turn.T @ (turned / (1 + sd**2 * kind.size))
    return seen, kind, sd, weighted.reshape(seen.values.shape)
