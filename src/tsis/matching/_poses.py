"""Pose hypotheses: for trial rotations, shape contexts and relaxation propose pairs, whose consensus is a pose.

The printed method measures angles from the direction to the mass centre, which outliers and missing parts rotate; that
causes most of its failures. Here the whole source is rotated by a grid of rotations, dense enough for the shape
contexts, and the pose is the affine map that the most trusted pairs agree on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from tsis.matching._log_polar import ANGLE_BINS, chi_squared, histograms, mean_distance
from tsis.matching._relaxation import NEIGHBOURS as SOURCE_NEIGHBOURS
from tsis.matching._relaxation import TARGET_NEIGHBOURS, Neighbourhood, label
from tsis.matching._spline import spread_indices

if TYPE_CHECKING:
    from tsis.matching._fit import Floats


NO_PARTNER_SUPPORT = 0.07  # support for having no partner
UPDATES = 20
COMPARED = 150  # source points whose shape contexts choose the rotations
LABELLED = {2: 6, 3: 30}  # rotations that are labelled, by dimension
MANY, LABELLED_OF_MANY = 200_000, 2  # number of pairs beyond which fewer rotations are labelled
CLEAR = 0.65  # agreement that ends the search
DRAWS = 250  # random samples of d + 1 pairs
CLOSE = 0.25  # root-mean-square radii: a pair farther from an affine map does not agree with it
LEAST_VOLUME, MOST_VOLUME = 0.1, 6.0  # factor of areas or volumes under a pose
MOST_SHEAR = 1.6  # mean squared singular value over their squared geometric mean; 1 for a similarity
LEAST_SPREAD = 0.1  # area or volume of the drawn points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pose:
    """An affine map, shape (d + 1, d) with the translation in row 0, and the weight of the pairs that agree on it."""

    affine: Floats
    agreement: float


def poses(source: Floats, target: Floats, *, rng: np.random.Generator) -> list[Pose]:
    """Poses of the source on the target by falling agreement; normalised points, shapes (n, d) and (m, d)."""
    scale = mean_distance(target)
    contexts = histograms(target, scale=scale)
    likely = _likely_rotations(source, contexts, scale)
    about = Neighbourhood.of(target, TARGET_NEIGHBOURS)
    here = Neighbourhood.of(source, SOURCE_NEIGHBOURS)
    poses: list[Pose] = []
    for rotation in likely[: LABELLED[source.shape[1]] if len(source) * len(target) < MANY else LABELLED_OF_MANY]:
        cost = chi_squared(histograms(source @ rotation.T, scale=scale), contexts)
        around = Neighbourhood.among(source @ rotation.T, here.index)
        labels = label(around, about, cost, single=NO_PARTNER_SUPPORT, updates=UPDATES)
        pose = agreed(source, target[labels.best], labels.trust**2, rng=rng)
        poses.append(Pose(affine=pose.affine, agreement=pose.agreement * float(labels.trust.mean())))
        if poses[-1].agreement > CLEAR:
            break
    return sorted(poses, key=lambda pose: -pose.agreement)


def _likely_rotations(source: Floats, contexts: Floats, scale: float) -> list[Floats]:
    """All rotations, by rising distance between shape contexts of sampled source points and the nearest target's."""
    sample = spread_indices(source, COMPARED)
    ranked = []
    unrotated = histograms(source, scale=scale)[sample]
    for number, rotation in enumerate(rotations(source.shape[1])):
        if source.shape[1] == 2:  # a rotation by whole angle bins only shifts them
            rotated = np.roll(unrotated.reshape(len(sample), -1, ANGLE_BINS), number, axis=-1).reshape(unrotated.shape)
        else:
            rotated = histograms(source @ rotation.T, scale=scale)[sample]
        ranked.append((float(chi_squared(rotated, contexts).min(axis=1).mean()), number, rotation))
    return [rotation for _, _, rotation in sorted(ranked, key=lambda item: item[:2])]


def whitened_poses(source: Floats, target: Floats, *, rng: np.random.Generator) -> list[Pose]:
    """Poses of the whitened sets.

    Whitening removes the affine part between complete shapes; with missing or added points it may introduce one.
    """
    here, there = whitening(source), whitening(target)
    back = np.linalg.inv(there)
    result = poses(source @ here, target @ there, rng=rng)
    return [replace(pose, affine=np.vstack([pose.affine[0] @ back, here @ pose.affine[1:] @ back])) for pose in result]


def whitening(points: Floats) -> Floats:
    """Symmetric matrix that gives points, shape (n, d), the same variance in all directions."""
    value, axis = np.linalg.eigh(np.cov(points, rowvar=False))
    return np.asarray((axis / np.sqrt(value * len(value))) @ axis.T)


def rotations(dimension: int) -> Floats:
    """Rotation matrices, shape (k, d, d): by whole angle bins in the plane, those of the icosahedron in space."""
    if dimension == 3:
        return np.asarray(Rotation.create_group("I").as_matrix())
    angles = 2 * np.pi * np.arange(ANGLE_BINS) / ANGLE_BINS
    return np.moveaxis(np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]]), 2, 0)


def agreed(source: Floats, partners: Floats, trust: Floats, *, rng: np.random.Generator) -> Pose:
    """Consensus of pairs (n, d): the best of the affine maps through d + 1 pairs drawn by ``trust`` (RANSAC).

    Where no sample gives a plausible map, the result is a translation.
    """
    count, dimension = source.shape
    chance = trust + 1e-9
    drawn = rng.choice(count, size=(DRAWS, dimension + 1), p=chance / chance.sum())
    from_, to = source[drawn], partners[drawn]
    spread, extent = from_[:, 1:] - from_[:, :1], to[:, 1:] - to[:, :1]
    wide = np.abs(np.linalg.det(spread)) > LEAST_SPREAD
    matrix = np.linalg.solve(spread[wide], extent[wide])
    volume = np.linalg.det(matrix)
    size = np.maximum(volume, 1e-12) ** (2 / dimension)
    plausible = (volume > LEAST_VOLUME) & (volume < MOST_VOLUME)
    plausible &= (matrix**2).sum(axis=(1, 2)) < MOST_SHEAR * dimension * size
    matrix = np.concatenate([matrix[plausible], np.eye(dimension)[None]])
    origin_from = np.concatenate([from_[wide, 0][plausible], source.mean(axis=0)[None]])
    origin_to = np.concatenate([to[wide, 0][plausible], partners.mean(axis=0)[None]])
    shift = origin_to - np.einsum("td,tde->te", origin_from, matrix)
    away = np.einsum("nd,tde->tne", source, matrix) + shift[:, None, :] - partners
    closeness = np.maximum(1 - (away**2).sum(axis=2) / CLOSE**2, 0.0) @ chance / chance.sum()
    best = int(np.argmax(closeness))
    return Pose(affine=np.vstack([shift[best], matrix[best]]), agreement=float(closeness[best]))
