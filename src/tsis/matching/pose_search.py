"""Maps from many rotations, with the evidence of each.

Affine maps are annealed from a grid of rotations, plain and between the whitened sets; the likeliest different ones are
annealed with a smooth field. Pieces of the target's curves are laid on each place of the source's outline. Then pairs
and map alternate, first soft, then one to one, and outlines slide along each other by whole points: slid maps explain
nearly as much as the right one, and only their evidence tells them apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as dataclass_field
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from tsis.compiled import fused
from tsis.matching import outline as outlines
from tsis.matching import refinement
from tsis.matching.annealing import AFFINE_SD, START, Cooling, anneal, annealed_map, balanced_pairs, field_design
from tsis.matching.methods import UNMATCHED, spacing
from tsis.matching.outline import chains, laid_pieces, main_curve, outline_alignments, slid, successors
from tsis.matching.pose_evidence import SIGMAS, PoseEvidence, SmoothField, hard_evidence, soft_evidence
from tsis.matching.relaxation import poses
from tsis.matching.spline import spline_basis, spread_indices

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from tsis.matching.methods import Floats, Integers


COARSE, FINE = (60, 90), (120, 300)  # largest samples of source and target
COARSE_SIGMAS = np.geomspace(0.4, 0.12, 8)  # in root-mean-square radii
FIRST_SIGMA, MIDDLE_SIGMA, LAST_SIGMA, FINE_STEPS = 0.3, 0.12, 0.5, 14  # the last in spacings
WIDE_SIGMAS = np.geomspace(0.9, 0.33, 8)
DIFFERENT = 0.1  # root-mean-square distance of two starts
ANNEALED, FOLLOWED, PROPOSED = 10, 6, 3  # starts annealed with a field, of them to the end, and poses beside them
SOFT_ROUNDS, BALANCINGS = 4, 10
GATES = (1.5, 1.2, 0.9, 0.7, 0.5, 0.4, 0.3, 0.3, 0.5, 0.5, 0.5, 0.5)  # largest distance of a pair, in spacings
LEAST_VARIANCE = 2 * SIGMAS[1] ** 2  # of a pair's distance
REJECTED = 9.0  # medians of the squared distance beyond which a pair is dropped
SLIDES, MOST_SLIDES = (-2, -1, 1, 2), 6
BEHIND = 1.5  # log evidence per point that a map may lie behind the best and still be refined


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseSearch:
    """What the steps of a search share; sets are normalised."""

    field: SmoothField
    target: Floats
    step: float  # distance of neighbours
    following: Integers  # next point of the source along its curve, shape (n,)
    ahead: Integers  # that of the target, shape (m,)
    curves: list[tuple[Integers, bool]]  # indices along each curve of the source, and whether it is closed
    outline: tuple[Integers, bool]  # the main one
    led: dict[PoseEvidence, PoseEvidence] = dataclass_field(default_factory=dict)  # where `_followed` led before

    @property
    def source(self) -> Floats:
        """The source's points, shape (n, d)."""
        return self.field.points

    @classmethod
    def of(cls, source: Floats, target: Floats) -> PoseSearch:
        """Between normalised points, shapes (n, d) and (m, d)."""
        following = successors(source)
        curves = chains(following)
        return cls(
            field=SmoothField.of(source),
            target=np.ascontiguousarray(target),
            step=max(spacing(source), spacing(target)),
            following=following,
            ahead=successors(target),
            curves=curves,
            outline=main_curve(source, curves),
        )


def search_poses(search: PoseSearch, *, rng: np.random.Generator) -> list[PoseEvidence]:
    """Maps by falling evidence; slid neighbours are among them."""
    return _shifted_again(search, _reattached_again(search, _searched(search, rng)))


def _searched(search: PoseSearch, rng: np.random.Generator) -> list[PoseEvidence]:
    aligned = sorted(_aligned_maps(search), key=lambda pose: -pose.log)
    if aligned and complete(search, aligned[0]):
        ranking = outlines.Ranking.of(search.field, search.target)
        better = [_mended(search, ranking, pose) for pose in distinct(aligned, DIFFERENT)[:MENDED]]
        return sorted([*chain.from_iterable(better), *aligned], key=lambda pose: -pose.log)
    maps = [pose for moved in _annealed_maps(search) if (pose := settled(search, moved)) is not None]
    evidence = _refined(search, maps, aligned)
    followed = [_followed(search, pose) for pose in evidence[:1]]
    if not any(_paired_whole(search, pose) for pose in evidence[:1]) and not any(_whole(search, p) for p in followed):
        followed += _laid_maps(search)
    evidence = sorted([*evidence, *followed], key=lambda pose: -pose.log)
    evidence = _improved_again(search, evidence)
    if evidence and (complete(search, evidence[0]) or _paired_whole(search, evidence[0])):
        return evidence
    proposed = [pose for moved in _proposed_maps(search, rng) if (pose := settled(search, moved)) is not None]
    more = _refined(search, proposed, evidence)
    if len(search.source) * len(search.target) > refinement.MANY_PAIRS and evidence and more[0] is evidence[0]:
        return more
    return _improved_again(search, more)


def _reattached_again(search: PoseSearch, evidence: list[PoseEvidence]) -> list[PoseEvidence]:
    """All maps, and those that loose points moved together and halves of the pairs lead to, while the likeliest gains.

    Loose points have no partner; they move to free targets.
    """
    few = len(search.source) * len(search.target) <= refinement.MANY_PAIRS
    for _ in range(MOST_PASSES if evidence and few else 0):
        top = evidence[0]
        again = refinement.reattached(search.field, search.target, search.step, top)
        done = _followed_maps(search, top, again)
        if not done:
            break
        done += _followed_maps(search, top, refinement.halved(search.source, top.matches))
        best = max(done, key=lambda pose: pose.log)
        if best.log > top.log:
            done.append(refinement.repatched(search.field, search.target, search.step, best))
        evidence = sorted([*evidence, *done], key=lambda pose: -pose.log)
        if evidence[0].log < top.log + LEAST_GAIN:
            break
    return evidence


def _shifted_again(search: PoseSearch, evidence: list[PoseEvidence]) -> list[PoseEvidence]:
    """All maps, and those of the likeliest slid along its outline by any number of points, until none is likelier.

    A shape that nearly has a symmetry fits its outline in several places; all of them must be among the maps.
    """
    ranking = outlines.Ranking.of(search.field, search.target)
    for _ in range(MOST_PASSES if evidence else 0):
        top = evidence[0]
        slid_maps = _followed_maps(search, top, refinement.shifted(search.outline, ranking, top))
        evidence = sorted([*evidence, *slid_maps], key=lambda pose: -pose.log)
        if evidence[0].log < top.log + LEAST_GAIN:
            break
    return evidence


def _improved_again(search: PoseSearch, evidence: list[PoseEvidence]) -> list[PoseEvidence]:
    """`_improved` until the likeliest map leaves no point without partner, or stays; of large sets once."""
    passes = MOST_PASSES if len(search.source) * len(search.target) <= refinement.MANY_PAIRS else 1
    for _ in range(passes if evidence else 0):
        before, evidence = evidence[0], _improved(search, evidence)
        if evidence[0].log < before.log + LEAST_GAIN or _whole(search, evidence[0]):
            break
    return evidence


def _improved(search: PoseSearch, evidence: list[PoseEvidence]) -> list[PoseEvidence]:
    """All maps, and those that growth, order along curves and shifts make of the likeliest."""
    ranking = outlines.Ranking.of(search.field, search.target)
    done = [_followed(search, pose) for pose in distinct(evidence, IMPROVED_DISTANCE)[:IMPROVED]]
    top = max(done, key=lambda pose: pose.log)
    for matches in refinement.shifted(search.outline, ranking, top):
        pose = hard_evidence(search.field, search.target, matches, width=top.width)
        if pose is not None:
            done += [pose, _followed(search, pose)]
    top = max(done, key=lambda pose: pose.log)
    rotated = distinct(refinement.rotated(search.field, search.target, search.step, top), IMPROVED_DISTANCE)[:ROTATED]
    done += [*rotated, *(_followed(search, pose) for pose in rotated)]
    done += _shifted_segments(search, ranking, max(done, key=lambda pose: pose.log))
    top = max(done, key=lambda pose: pose.log)
    if len(search.target) > DENSER * len(search.source):
        for pose in _target_slid_maps(search, top):
            done.append(pose)
            top = max(top, pose, key=lambda pose: pose.log)
    done.append(refinement.repatched(search.field, search.target, search.step, top))
    return sorted([*evidence, *done], key=lambda pose: -pose.log)


def _shifted_segments(search: PoseSearch, ranking: outlines.Ranking, top: PoseEvidence) -> list[PoseEvidence]:
    """Maps of segments of the curves that slid into gaps, while the likeliest gains."""
    done: list[PoseEvidence] = []
    for _ in range(MOST_SEGMENTS):
        items = [
            pose
            for order, closed in search.curves
            if len(order) > 5
            for matches in refinement.segment_shifts(order, closed, search.ahead, ranking, top)
            if (pose := hard_evidence(search.field, search.target, matches, width=top.width)) is not None
        ]
        best = max(items, key=lambda pose: pose.log, default=top)
        if best.log <= top.log + 0.01:
            break
        top = _followed(search, best)
        done += [*items, top]
    return done


def _mended(search: PoseSearch, ranking: outlines.Ranking, pose: PoseEvidence) -> list[PoseEvidence]:
    """Maps of an alignment after growth and re-pairing: points of a curve may be in the wrong order, and off by one."""
    pose = refinement.grown(search.field, search.target, search.step, pose)
    if pose.sigma > CLEAN * SIGMAS[0]:
        pose = refinement.repatched(search.field, search.target, search.step, pose)
    return [pose, *_shifted_segments(search, ranking, pose)]


def _target_slid_maps(search: PoseSearch, found: PoseEvidence) -> Iterator[PoseEvidence]:
    """Maps whose pairs slid along the curves of the denser target."""
    ahead = search.ahead
    back = np.full(len(ahead), UNMATCHED)
    linked = np.flatnonzero(ahead != UNMATCHED)
    back[ahead[linked]] = linked
    top = found
    for direction in (ahead, back):
        for _ in range(MOST_TARGET_SLIDES):
            matches = np.where(top.matches == UNMATCHED, UNMATCHED, direction[top.matches])
            pose = hard_evidence(search.field, search.target, matches, width=top.width)
            if pose is None:
                break
            pose = _followed(search, pose)
            if pose.log <= top.log + 0.01:
                break
            top = pose
            yield pose


def _followed_maps(search: PoseSearch, top: PoseEvidence, proposals: Iterable[Integers]) -> list[PoseEvidence]:
    """The maps that growth and order reach from matches which a map proposes."""
    maps = (hard_evidence(search.field, search.target, matches, width=top.width) for matches in proposals)
    return [_followed(search, pose) for pose in maps if pose is not None]


def _followed(search: PoseSearch, pose: PoseEvidence) -> PoseEvidence:
    """The map that growth and order along curves reach."""
    for _ in range(3):
        before = pose
        if before not in search.led:
            pose = refinement.grown(search.field, search.target, search.step, pose)
            pose = refinement.chained(search.field, search.target, search.step, search.curves, pose)
            search.led[before] = pose
        pose = search.led[before]
        if pose.log < before.log + 0.5:
            break
    return pose


COOLING, COLDEST, COOLED = 0.85, 0.35, 3
WHOLE = 0.97  # fraction of the points that have a partner in a complete map
MOST_LAID = 2  # curves of the source that pieces are laid on
ROTATED = 4  # maps of the rotated source that are followed
MENDED, CLEAN = 8, 1.1  # alignments that are mended, and noise in SIGMAS[0] of a map that needs no mending
MOST_SEGMENTS, MOST_TARGET_SLIDES = 8, 4
DENSER = 1.2  # ratio of the sets' sizes beyond which pairs also slide along the target's curves
IMPROVED, IMPROVED_DISTANCE = 3, 0.1
MOST_PASSES, LEAST_GAIN = 4, 0.5  # passes of all moves, and log evidence that one must gain for the next


def _laid_maps(search: PoseSearch) -> list[PoseEvidence]:
    """Maps of pieces of the target's curves laid on the source's: hidden parts mislead an annealing."""
    ranking = outlines.Ranking.of(search.field, search.target)
    curves = [search.outline] if len(search.outline[0]) else sorted(search.curves, key=lambda curve: -len(curve[0]))
    pairs = (matches for curve in curves[:MOST_LAID] for matches in laid_pieces(curve, ranking, search.ahead))
    width = outlines.RANK_WIDTH
    maps = [hard_evidence(search.field, search.target, matches, width=width) for matches in pairs]
    upright = [pose for pose in maps if pose is not None and np.linalg.det(pose.affine[1:]) > 0]
    # Before they are followed, few pairs on clutter may have more evidence than many on a curve with strays.
    return [_followed(search, pose) for pose in distinct(upright, DIFFERENT)]


def _aligned_maps(search: PoseSearch) -> list[PoseEvidence]:
    """Maps of the alignments of two outlines."""
    alignments = outline_alignments(search.field, search.target, search.following, search.ahead)
    return [
        pose for alignment in alignments if (pose := hard_evidence(search.field, search.target, alignment)) is not None
    ]


def settled(search: PoseSearch, moved: Floats, *, rounds: int = SOFT_ROUNDS) -> PoseEvidence | None:
    """The map that alternating soft pairs and fields reach from moved points, shape (n, d)."""
    if len(search.source) * len(search.target) > refinement.MANY_PAIRS:
        first = hard_evidence(
            search.field, search.target, refinement.one_to_one(moved, search.target, GATES[0] * search.step)
        )
        return None if first is None else _tightened(search, first)
    sigma, best = LAST_SIGMA * search.step, None
    for _ in range(rounds):
        pairs = balanced_pairs(np.ascontiguousarray(moved), search.target, sigma, BALANCINGS)
        best = soft_evidence(search.field, search.target, pairs)
        if best is None:
            return None
        moved, sigma = best.moved, max(best.sigma, 0.1 * search.step)
    return best


def complete(search: PoseSearch, pose: PoseEvidence) -> bool:
    """Whether nearly all points of the smaller set have a partner at the measurement's standard deviation."""
    fewest = min(len(search.source), len(search.target))
    return pose.paired >= WHOLE * fewest and pose.sigma <= 1.5 * SIGMAS[1]


def _whole(search: PoseSearch, pose: PoseEvidence) -> bool:
    """Whether a complete map leaves nearly no point of either set without partner."""
    return complete(search, pose) and _paired_whole(search, pose)


def _paired_whole(search: PoseSearch, pose: PoseEvidence) -> bool:
    """Whether a map, however noisy, leaves nearly no point of either set without partner: no part is hidden."""
    return pose.paired >= WHOLE * max(len(search.source), len(search.target))


def _refined(
    search: PoseSearch, maps: Iterable[PoseEvidence], evidence: Iterable[PoseEvidence] = ()
) -> list[PoseEvidence]:
    """All maps with their tightened and slid successors, by falling evidence."""
    refined = list(evidence)
    for pose in sorted(distinct(maps, 0.3 * search.step), key=lambda pose: -pose.log)[:FOLLOWED]:
        best = max((other.log for other in refined), default=pose.log)
        refined.append(pose)
        if pose.log < best - BEHIND * len(search.target):
            continue
        tight = _tightened(search, pose)
        refined += [tight, *_slid_maps(search, tight)]
    return sorted(refined, key=lambda pose: -pose.log)


def distinct(maps: Iterable[PoseEvidence], least: float) -> list[PoseEvidence]:
    """The maps by falling evidence that lie at least so far from those before them."""
    apart: list[PoseEvidence] = []
    chosen = np.empty((0, 0))
    for pose in sorted(maps, key=lambda pose: -pose.log):
        moved = pose.moved.ravel()
        if not apart or _is_far(moved, chosen[: len(apart)], least**2 * len(pose.moved)):
            if len(apart) == len(chosen):
                chosen = np.concatenate([chosen.reshape(-1, len(moved)), np.empty((len(apart) + 8, len(moved)))])
            chosen[len(apart)] = moved
            apart.append(pose)
    return apart


@fused
def _is_far(moved: Floats, others: Floats, least: float) -> bool:
    """Whether a vector, shape (k,), lies farther than a squared distance from all rows, shape (l, k)."""
    for row in range(len(others)):
        total = 0.0
        for k in range(len(moved)):
            total += (moved[k] - others[row, k]) ** 2
            if total > least:
                break
        if total <= least:
            return False
    return True


def _tightened(search: PoseSearch, found: PoseEvidence) -> PoseEvidence:
    """The best map while pairs are assigned one to one within a shrinking distance."""
    moved, best, last = found.moved, found, None
    for gate in GATES:
        matches = refinement.one_to_one(moved, search.target, gate * search.step)
        rows = np.flatnonzero(matches != UNMATCHED)
        away = ((moved[rows] - search.target[matches[rows]]) ** 2).sum(axis=1)
        if len(rows):
            matches[rows[away > REJECTED * max(float(np.median(away)), LEAST_VARIANCE)]] = UNMATCHED
        if last is not None and np.array_equal(matches, last):
            continue
        last = matches
        pose = hard_evidence(search.field, search.target, matches, width=found.width)
        if pose is None:
            break
        moved = pose.moved
        best = max(best, pose, key=lambda pose: pose.log)
    return best


def _slid_maps(search: PoseSearch, found: PoseEvidence) -> Iterator[PoseEvidence]:
    """Maps whose pairs slid along the outline, from the best found so far on."""
    top = found
    for _ in range(MOST_SLIDES):
        matches = refinement.one_to_one(top.moved, search.target, max(3 * top.sigma, 0.6 * search.step))
        better = top
        for steps in SLIDES:
            pose = _repaired(search, slid(matches, search.following, steps), top.width)
            if pose is None:
                continue
            yield pose
            if pose.log > better.log + 0.01:
                better = pose
        if better is top:
            return
        top = _tightened(search, better)
        yield top


def _repaired(search: PoseSearch, matches: Integers, width: float) -> PoseEvidence | None:
    """The better of the map of the matches and the map of the pairs that it leads to."""
    pose = hard_evidence(search.field, search.target, matches, width=width)
    if pose is None:
        return None
    matches = refinement.one_to_one(pose.moved, search.target, max(2 * pose.sigma, 0.3 * search.step))
    again = hard_evidence(search.field, search.target, matches, width=width)
    return pose if again is None else max(pose, again, key=lambda pose: pose.log)


def _annealed_maps(search: PoseSearch) -> Iterator[Floats]:
    """Moved source points of the best starts, annealed with a field."""
    design, rows, sample, ridge, sigmas = _sampled_field(search)
    here = np.ascontiguousarray(design[rows])
    middle = int(np.searchsorted(-sigmas, -MIDDLE_SIGMA))
    starts = [_padded(affine, design.shape[1]) for affine in _coarse_starts(search)]
    maps = [annealed_map(here, ridge, sample, start, sigmas[:middle], 2) for start in starts]
    maps.sort(key=lambda scored: -scored[1])
    for coordinates, _ in maps[:FOLLOWED]:
        yield design @ annealed_map(here, ridge, sample, coordinates, sigmas[middle:], 2)[0]
    dimension = search.source.shape[1]
    start = _padded(np.eye(dimension + 1, dimension, -1), design.shape[1])
    yield design @ annealed_map(here, ridge, sample, start, np.concatenate([WIDE_SIGMAS, sigmas]), 2)[0]


def _proposed_maps(search: PoseSearch, rng: np.random.Generator) -> Iterator[Floats]:
    """Moved source points: a spline annealed from the identity, and poses of relaxation labelling with a field."""
    source, target = search.source, search.target
    design, rows, sample, ridge, sigmas = _sampled_field(search)
    basis = spline_basis(source, control=source[rows])
    cooling = Cooling(factor=COOLING, start=START, end=(COLDEST * search.step) ** 2, rounds=COOLED)
    yield basis.design @ anneal(basis, basis.rest, target, cooling)
    here = np.ascontiguousarray(design[rows])
    for pose in poses(source[rows], sample, rng=rng)[:PROPOSED]:
        yield design @ annealed_map(here, ridge, sample, _padded(pose.affine, design.shape[1]), sigmas, 2)[0]


def _sampled_field(search: PoseSearch) -> tuple[Floats, Integers, Floats, Floats, Floats]:
    """Design of a field at all source points, rows of their sample, sample of the target, ridge, falling sigmas."""
    source, target = search.source, search.target
    rows, columns = spread_indices(source, FINE[0]), spread_indices(target, FINE[1])
    sample = np.ascontiguousarray(target[columns])
    design, ridge = field_design(source, rows)
    last = max(LAST_SIGMA * max(spacing(source[rows]), spacing(sample)), 0.03)
    return design, rows, sample, ridge, np.geomspace(FIRST_SIGMA, min(last, MIDDLE_SIGMA / 2), FINE_STEPS)


def _padded(affine: Floats, count: int) -> Floats:
    """Coordinates, shape (count, d), of an affine map without bending."""
    start = np.zeros((count, affine.shape[1]))
    start[: len(affine)] = affine
    return start


def _coarse_starts(search: PoseSearch) -> list[Floats]:
    """Affine parts, shape (d + 1, d), of the likeliest different affine maps from all rotations."""
    source, target = search.source, search.target
    dimension = source.shape[1]
    here = source[spread_indices(source, COARSE[0])]
    there = np.ascontiguousarray(target[spread_indices(target, COARSE[1])])
    design = np.column_stack([np.ones(len(here)), here])
    ridge = np.concatenate([[1e-6], np.full(dimension, AFFINE_SD**-2)])
    maps = [
        annealed_map(design, ridge, there, np.vstack([np.zeros(dimension), matrix]), COARSE_SIGMAS, 1)
        for matrix in refinement.start_matrices(source, target)
    ]
    maps.sort(key=lambda scored: -scored[1])
    chosen: list[Floats] = []
    for affine, _ in maps:
        moved = [design @ (affine - other) for other in chosen]
        if all((away**2).sum(axis=1).mean() > DIFFERENT**2 for away in moved):
            chosen.append(affine)
            if len(chosen) == ANNEALED:
                break
    return chosen
