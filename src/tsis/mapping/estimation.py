"""Estimate the map of a scan: blocks of presses, each sampled, and one map of all."""

from __future__ import annotations

import hashlib
import io
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import FileInputError, InputError
from tsis.files.archive import read_arrays
from tsis.files.atomic import write_durably
from tsis.files.cache import content_key
from tsis.files.reading import read_bytes
from tsis.mapping.answers import (
    AREA_MM,
    BLIND_CONTRAST,
    BLIND_STEP_MM,
    PLACES,
    Voxels,
    area_probability,
    blind_diameter,
    clusters,
    lump_of,
    next_places,
    painted,
    uneven_modulus,
    visibility,
)
from tsis.mapping.flags import (
    AT_END,
    DEEP,
    DEEP_CHANGE,
    FINITE_LOAD,
    HARD_MISFIT,
    LARGE_BLIND,
    LUMP_POSSIBLE,
    LUMP_SHALLOW,
    LUMPS_CLOSE,
    MAP_DOES_NOT_FIT,
    NARROW_MM,
    NOT_COVERED,
    POSSIBLE,
    PRESENT,
    PRESSES_DEEP,
    PRESSES_LEFT_OUT,
    PRIORS_END,
    SAMPLER_NOT_SETTLED,
    SHALLOW_MM,
    UNEVEN_AT_END,
    UNSETTLED,
    UNTRUSTED_MAP_FLAGS,
)
from tsis.mapping.lump_map import LumpMap, MapNumbers, NextPlace
from tsis.mapping.observation import observe
from tsis.mapping.places import PLACE_MATTERS_MM, shifts, with_place_errors, with_place_spread
from tsis.mapping.posterior import BlockLikelihood, Region, Sampler, Samples, field_sds, greedy_fit, of_presses
from tsis.mapping.prior import MapPrior
from tsis.mapping.scan import Scan, first_few
from tsis.mapping.signals import LUMP_COLUMNS, X, Y
from tsis.mapping.stiffness import observe_stiffness, suited_prior
from tsis.mapping.uneven_field import LENGTHS_MM
from tsis.model.estimate import IMPROBABLE, Estimate, probability_bound
from tsis.model.press import MN_PER_N
from tsis.model.probe import Probe
from tsis.model.require import require_integer, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tsis.mapping.lump_map import Lump
    from tsis.mapping.observation import Observation
    from tsis.mapping.posterior import Fit
    from tsis.mapping.signals import Floats, Integers
    from tsis.model.calibration import Calibration
    from tsis.model.flag import Finding


BLOCK = 25  # most presses that share a block; with its neighbours a block has about twice as many
NEIGHBOURS = 0.9  # of the face's radius: presses this near to a block's area are sampled with it
STRAINS = ("small", "finite")
LARGEST_RESUME_BYTES = 2**28
RESUMED = (
    *("counts", "lumps", "sd", "length_mm", "shift_mm", "misfit", "numbers", "index"),
    *("z", "y", "x", "even", "variance", "blind_mm", "gains"),
)  # arrays of a finished block in the file
TYPICAL_LENGTH_MM = 6.0  # of the field, by which slopes are found before any lump is known
TYPICAL_SIZE_MM, TYPICAL_TOP_MM = 8.0, 8.0  # of the lump by which the blind zone is judged
MOST_VOXELS = 4_000_000
REPORTS = 38  # of progress a fit of a block, beside one in 500 steps
LARGE_MM2 = 20_000.0  # an area that few presses may have
FARTHEST = 5.0  # radii of the face from press to press, over the area of a block: farther apart all is blind


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block:
    """One block of presses, sampled, and the map's fields within its core.

    The likelihood, which takes most of the memory, is not kept.
    """

    core_low: Floats
    core_high: Floats
    samples: Samples
    shift_mm: Floats  # posterior mean of the error of each place, (presses, 2)
    misfit: float  # mean square of the whitened residual
    numbers: int
    index: Integers  # of its presses in the scan
    voxels: tuple[Integers, Integers, Integers]  # of the core along depth, y and x
    even: Floats  # mean of the logarithm of the tissue's modulus in these voxels
    variance: Floats  # of that logarithm
    blind_mm: Floats  # least diameter that the presses would have shown
    gains: list[NextPlace]

    def of_core(self, lumps: Floats) -> Floats:
        """The lumps whose centre lies in the core."""
        inside = ((lumps[:, :2] >= self.core_low) & (lumps[:, :2] < self.core_high)).all(axis=1)
        return lumps[inside]


def estimate_map(
    scan: Scan,
    *,
    probe: Probe | None = None,
    calibration: Calibration | None = None,
    prior: MapPrior | None = None,
    strain: str | None = None,
    voxel_mm: float = 2.0,
    seed: int = 0,
    steps: int = 20000,
    progress: Callable[[int, int], None] | None = None,
    resume: Path | None = None,
    start: LumpMap | None = None,
) -> LumpMap:
    """Map lumps under the area of a scan.

    Parameters
    ----------
    scan
        The presses.
    probe
        The probe that pressed; not needed for pairs of travel and force.
    calibration
        Response of grey level to pressure and the errors; needed for frames.
    prior
        Tissue and lumps; `MapPrior` by default, for an indenter with the modulus of its median press.
    strain
        Mechanics of the model: ``"small"``, the default, or ``"finite"``, which corrects the press without lump, and
        the lumps' signals as those of lumps on the axis, from the tables of finite strain. A probe that is not in the
        catalog waits for its table, some ten minutes once. Refused for pairs of travel and force, and for forces and
        priors that the table does not hold.
    voxel_mm
        Width of the map's voxels, in [0.5, 20].
    seed
        Of the sampler.
    steps
        Steps of the sampler a block of presses, in [500, 10 million].
    progress
        Called with (done, all).
    resume
        A file in which an interrupted estimate of several blocks continues; it is written block by block.
    start
        The map of the same scan before its newest presses: its lumps and its tissue are the start in place of a search
        through all kinds of uneven tissue. With 1000 steps that takes seconds. Such a map guides; map the whole scan
        without ``start`` before its numbers are used.

    Returns
    -------
    LumpMap
        Lumps with intervals, probabilities, unevenness, blind zone and next places.

    Raises
    ------
    InputError
        When a press does not fit the probe, or too few remain.
    NotCalibratedError
        When frames come without calibration, or it is another probe's.
    """
    require_type("scan", scan, Scan)
    prior = suited_prior(scan) if prior is None else prior
    require_type("prior", prior, MapPrior)
    if start is not None:
        require_type("start", start, LumpMap)
    require_number("voxel_mm", voxel_mm, 0.5, 20.0, hint="millimetres")
    require_integer("steps", steps, 500, 10**7)
    require_integer("seed", seed, 0, 2**63 - 1)
    strain = require_one_of("strain", strain or STRAINS[0], STRAINS)
    if scan.kind == "travel_force":
        if strain == "finite":
            raise InputError(
                name="strain",
                requirement="must be 'small' for pairs of travel and force",
                value="'finite'",
                cure="leave strain away, and press less deep",
            )
        observation = observe_stiffness(scan, prior)
    else:
        if probe is None:
            raise InputError("probe must be given for frames and pressures; got None")
        require_type("probe", probe, Probe)
        observation = observe(scan, probe, calibration, prior, strain=strain)
    areas = block_areas(observation.places_mm)
    whole = Region.of(observation, prior, expected=prior.lumps_per_scan)
    voxels = Voxels.of(whole.low[:2], whole.high[:2], prior.thickness_mm, voxel_mm)
    _require_size(observation, areas, voxels, voxel_mm)
    done, total = 0, len(areas) * _reports(observation, steps, start)

    def report() -> None:
        nonlocal done
        done = min(done + 1, total - 1)
        if progress is not None:
            progress(done, total)

    stored = _Resumed(resume, _key(scan, probe, calibration, prior, strain, voxel_mm, seed, steps, start is not None))
    blocks = []
    for number, (low, high) in enumerate(areas):
        blocks.append(_block(observation, prior, whole, voxels, low, high, stored, number, seed, steps, start, report))
    result = _map(scan, observation, blocks, prior, voxels, seed, strain=strain, guides=start is not None)
    if progress is not None:
        progress(total, total)
    return result


def _require_size(
    observation: Observation, areas: list[tuple[Floats, Floats]], voxels: Voxels, voxel_mm: float
) -> None:
    """`InputError` for places too far apart, and for more voxels than a computer's memory holds."""
    places = observation.places_mm
    for low, high in areas:
        inside = places[((places >= low) & (places < high)).all(axis=1)]
        area, apart = float(np.prod(np.ptp(inside, axis=0))), FARTHEST * observation.radius_mm
        if area > max(LARGE_MM2, len(inside) * apart**2):
            raise InputError(
                f"presses must lie within some {apart:g} mm of one another; {len(inside)} of them are spread over "
                f"{area / 100:.0f} cm2: give x_mm and y_mm in mm, or map each part by itself"
            )
    count = int(np.prod(voxels.shape))
    if count > MOST_VOXELS:
        raise InputError(
            f"voxel_mm must give at most {MOST_VOXELS} voxels; {voxel_mm:g} mm gives {count}: give larger voxels"
        )


def block_areas(places: Floats) -> list[tuple[Floats, Floats]]:
    """Halve the plane until no part has more than `BLOCK` of the places (n, 2); low and high corner of each part."""
    parts = [(np.full(2, -np.inf), np.full(2, np.inf), places)]
    done = []
    while parts:
        low, high, inside = parts.pop()
        if len(inside) <= BLOCK:
            done.append((low, high))
            continue
        axis = int(np.argmax(np.ptp(inside, axis=0)))
        middle = float(np.median(inside[:, axis]))
        right = inside[:, axis] >= middle
        if right.all():  # many presses at one coordinate
            done.append((low, high))
            continue
        left_high, right_low = high.copy(), low.copy()
        left_high[axis] = right_low[axis] = middle
        parts += [(low, left_high, inside[~right]), (right_low, high, inside[right])]
    return done


def _block(
    observation: Observation,
    prior: MapPrior,
    whole: Region,
    voxels: Voxels,
    low: Floats,
    high: Floats,
    stored: _Resumed,
    number: int,
    seed: int,
    steps: int,
    start: LumpMap | None,
    report: Callable[[], None],
) -> Block:
    kept = stored.block(number, low, high)
    if kept is not None:
        for _ in range(_reports(observation, steps, start)):
            report()
        return kept
    reach, alone = NEIGHBOURS * observation.radius_mm, bool(np.isinf(low).all() and np.isinf(high).all())
    places = observation.places_mm
    near = np.flatnonzero(((places >= low - reach) & (places <= high + reach)).all(axis=1))
    part = of_presses(observation, near)
    area = float(np.prod(whole.high[:2] - whole.low[:2]))
    region = Region.of(part, prior, expected=1.0)
    share = float(np.prod(region.high[:2] - region.low[:2])) / area
    region = replace(region, expected=prior.lumps_per_scan * min(share, 1.0))
    length = None if start is None else float(np.median(start.untrusted.unevenness.untrusted.samples["length_mm"]))
    rows = np.zeros((0, LUMP_COLUMNS)) if start is None else _rows_within(start, low - reach, high + reach)
    likelihood, fit, candidates, gain, slopes = _fitted(part, prior, region, rows, length, report)
    rng = np.random.default_rng([seed, number])
    samples = Sampler(likelihood, region, fit, candidates, gain, rng).run(steps, report=report)
    likelihood.settle()
    seen = likelihood.observation
    residual = seen.values - likelihood.signal(fit.lumps)
    weights = likelihood.log_weights(residual)
    kind, sd = np.unravel_index(weights.argmax(), weights.shape)
    field = likelihood.kinds[int(kind)]
    turned = field.turn @ residual.ravel()
    misfit = float((turned**2 / (1 + likelihood.sds[int(sd)] ** 2 * field.size)).mean())
    fit = replace(fit, kind=int(kind), sd=int(sd))
    if slopes is not None:
        samples = with_place_spread(samples, part, likelihood, fit, np.random.default_rng([seed, 2 * 10**6 + number]))
    x, y = (np.flatnonzero((axis >= low[k]) & (axis < high[k])) for k, axis in enumerate((voxels.x_mm, voxels.y_mm)))
    own = Voxels(x_mm=voxels.x_mm[x], y_mm=voxels.y_mm[y], depth_mm=voxels.depth_mm)
    even = variance = blind = np.zeros(own.shape)
    gains: list[NextPlace] = []
    if len(x) and len(y):
        even, variance = uneven_modulus(likelihood, fit.lumps, own)
        blind = _blind(likelihood, samples, own)
        rng = np.random.default_rng([seed, 10**6 + 1 + number])
        for place in next_places(likelihood, region, samples.learnt, fit, rng):
            at = np.array([place.x_mm, place.y_mm])
            if alone or ((at >= low) & (at < high)).all():
                gains.append(place)
    block = Block(
        core_low=low,
        core_high=high,
        samples=samples,
        shift_mm=np.zeros((len(part.values), 2)) if slopes is None else shifts(part, likelihood, fit.lumps, slopes),
        misfit=misfit,
        numbers=part.values.size,
        index=part.index,
        voxels=(np.arange(voxels.shape[0]), y, x),
        even=even,
        variance=variance,
        blind_mm=blind,
        gains=gains,
    )
    stored.keep(number, block)
    return block


def _places_err(observation: Observation) -> bool:
    return bool((observation.place_sd_mm > PLACE_MATTERS_MM).any())


def _reports(observation: Observation, steps: int, start: LumpMap | None) -> int:
    """Reports of progress of a block, which is fitted twice where places err."""
    return REPORTS * (2 if _places_err(observation) and start is None else 1) + steps // 500


def _fitted(
    part: Observation, prior: MapPrior, region: Region, rows: Floats, length: float | None, report: Callable[[], None]
) -> tuple[BlockLikelihood, Fit, Floats, Floats, Floats | None]:
    """Likelihood and greedy fit of a block; where places err, by the slopes of its presses, found with the lumps."""
    seen, slopes = part, None
    errs = _places_err(part)
    if errs:
        first = BlockLikelihood(part, prior, length_mm=length or TYPICAL_LENGTH_MM)
        seen, slopes = with_place_errors(part, first, rows)
        del first
        report()
    likelihood = BlockLikelihood(seen, prior, length_mm=length, report=report)
    fit, candidates, gain = greedy_fit(likelihood, region, start=rows, report=report)
    if errs and length is None:  # once more, with the slopes of the lumps that were found
        seen, slopes = with_place_errors(part, likelihood, fit.lumps, slopes)
        del likelihood  # most of the memory
        likelihood = BlockLikelihood(seen, prior, report=report)
        fit, candidates, gain = greedy_fit(likelihood, region, start=fit.lumps, report=report)
    if not len(fit.lumps):
        likelihood.with_signal_error(fit.lumps)
    return likelihood, fit, candidates, gain, slopes


def _blind(likelihood: BlockLikelihood, samples: Samples, voxels: Voxels) -> Floats:
    """Least diameter that the presses of a block would have shown, at its voxels."""
    sd = float(np.mean(samples.sd))
    length = float(np.exp(np.mean(np.log(samples.length_mm))))
    grid = (_axis(voxels.x_mm), _axis(voxels.y_mm))
    points = np.array([(a, b) for b in grid[1] for a in grid[0]])
    return blind_diameter(visibility(likelihood, sd, length, points, BLIND_CONTRAST), grid, voxels)


def _rows_within(earlier: LumpMap, low: Floats, high: Floats) -> Floats:
    """Lumps of an earlier map in an area, as rows of the sampler."""
    rows = []
    for lump in earlier.untrusted.lumps:
        median = {name: float(np.median(values)) for name, values in lump.estimate.untrusted.samples.items()}
        place = np.array([median["x_mm"], median["y_mm"]])
        if (place >= low).all() and (place <= high).all():
            size, contrast = np.log(median["diameter_mm"]), np.log(median["contrast"])
            rows.append([*place, median["centre_depth_mm"], size, contrast])
    return np.array(rows).reshape(-1, LUMP_COLUMNS)


class _Resumed:
    """Finished blocks in a file, as long as it belongs to the same estimate."""

    def __init__(self, path: Path | None, key: str) -> None:
        self._path, self._key, self._name = path, key, "" if path is None else path.name
        self._arrays: dict[str, Any] = {}
        if path is not None and not path.parent.is_dir():
            raise InputError(f"resume must name a file in a folder that exists; there is no {str(path.parent)!r}")
        if path is not None and path.exists():
            try:
                arrays = read_arrays(read_bytes(path, most=LARGEST_RESUME_BYTES))
            except FileInputError as error:
                raise FileInputError(f"resume must name a file that an estimate wrote; {path.name}: {error}") from error
            if "key" not in arrays or arrays["key"].tobytes() != key.encode():
                raise InputError(
                    f"resume must name a file of the same scan, prior, voxels, seed and steps; {path.name} is of "
                    "others: name another file"
                )
            self._arrays = arrays

    def block(self, number: int, low: Floats, high: Floats) -> Block | None:
        """A finished block, or None."""
        if f"misfit{number}" not in self._arrays:
            return None
        try:
            return self._block(number, low, high)
        except (KeyError, ValueError, TypeError, IndexError) as error:
            raise FileInputError(
                f"resume must name a file that an estimate wrote; {self._name} is damaged: name another file"
            ) from error

    def _block(self, number: int, low: Floats, high: Floats) -> Block:
        kept = {name: self._arrays[f"{name}{number}"] for name in RESUMED}
        states, voxels = len(kept["counts"]), tuple(len(kept[axis]) for axis in "zyx")
        shapes = {
            "lumps": (int(kept["counts"].sum()), LUMP_COLUMNS),
            **dict.fromkeys(("even", "variance", "blind_mm"), voxels),
            **{name: (states, *kept[name].shape[1:]) for name in ("sd", "length_mm")},
        }
        finite = all(np.isfinite(values).all() for name, values in kept.items() if name != "blind_mm")
        if not finite or any(kept[name].shape != shape for name, shape in shapes.items()):
            raise ValueError("arrays that no estimate wrote")
        return Block(
            core_low=low,
            core_high=high,
            samples=Samples(
                lumps=tuple(np.split(kept["lumps"], np.cumsum(kept["counts"])[:-1])),
                learnt=(),  # the places to press next, which need them, are kept
                sd=kept["sd"],
                length_mm=kept["length_mm"],
                accepted={},
            ),
            shift_mm=kept["shift_mm"],
            misfit=float(kept["misfit"]),
            numbers=int(kept["numbers"]),
            index=kept["index"],
            voxels=(kept["z"], kept["y"], kept["x"]),
            even=kept["even"],
            variance=kept["variance"],
            blind_mm=kept["blind_mm"],
            gains=[NextPlace(x_mm=x, y_mm=y, gain_nats=gain) for x, y, gain in kept["gains"].tolist()],
        )

    def keep(self, number: int, block: Block) -> None:
        """Write a finished block."""
        if self._path is None:
            return
        samples, (z, y, x) = block.samples, block.voxels
        gains = np.array([(place.x_mm, place.y_mm, place.gain_nats) for place in block.gains]).reshape(-1, 3)
        values = (
            *(np.array([len(lumps) for lumps in samples.lumps]), np.concatenate(samples.lumps)),
            *(samples.sd, samples.length_mm, block.shift_mm, block.misfit, block.numbers, block.index),
            *(z, y, x, block.even, block.variance, block.blind_mm, gains),
        )
        self._arrays["key"] = np.frombuffer(self._key.encode(), dtype=np.uint8)
        self._arrays |= {f"{name}{number}": np.asarray(value) for name, value in zip(RESUMED, values, strict=True)}
        buffer = io.BytesIO()
        np.savez(buffer, **self._arrays)
        write_durably(self._path, buffer.getvalue())


def _key(
    scan: Scan,
    probe: Probe | None,
    calibration: Calibration | None,
    prior: MapPrior,
    strain: str,
    voxel_mm: float,
    seed: int,
    steps: int,
    guides: bool,
) -> str:
    digest = hashlib.sha256()
    for press in scan.presses:
        for values in (press.pressure_kpa, press.travel_force, None if press.frame is None else press.frame.grey):
            if values is not None:
                digest.update(np.ascontiguousarray(values).tobytes())
        frame = None if press.frame is None else (press.frame.full_scale, press.frame.mm_per_pixel, press.frame.axis_px)
        stated = (press.place_mm, press.place_sd_mm, press.angle_deg, press.measured_force_n, press.force_sd)
        digest.update(repr((stated, press.noise_kpa, press.reference, frame)).encode())
    return content_key(
        {
            "scan": digest.hexdigest(),
            "indenter": None if scan.indenter is None else asdict(scan.indenter),
            "probe": None if probe is None else asdict(probe),
            "calibration": None if calibration is None else calibration.provenance(),
            "prior": asdict(prior),
            "run": [strain, voxel_mm, seed, steps, guides],
        }
    )


def _combined(blocks: list[Block]) -> tuple[Floats, ...]:
    """States of the whole scan: one of each block, which are independent."""
    count = min(len(block.samples.lumps) for block in blocks)
    return tuple(
        np.concatenate([block.of_core(block.samples.lumps[state]) for block in blocks]) for state in range(count)
    )


def _map(
    scan: Scan,
    observation: Observation,
    blocks: list[Block],
    prior: MapPrior,
    voxels: Voxels,
    seed: int,
    *,
    strain: str,
    guides: bool,
) -> LumpMap:
    rng = np.random.default_rng([seed, 10**6])
    states = _combined(blocks)
    lumps: list[Lump] = []
    findings: list[Finding] = []
    for cluster in clusters(states):
        if cluster.probability >= PRESENT:
            lump, said = lump_of(cluster, len(lumps) + 1, prior, rng)
            lumps.append(lump)
            findings += said
        elif cluster.probability >= POSSIBLE:
            x_mm, y_mm = np.median(cluster.samples[:, [X, Y]], axis=0).tolist()
            findings.append(LUMP_POSSIBLE.finding(x_mm=x_mm, y_mm=y_mm, probability=cluster.probability))
    counts = np.bincount([len(one) for one in states])
    probability, first, second = painted(states, voxels)
    even, variance, blind = np.zeros(voxels.shape), np.zeros(voxels.shape), np.full(voxels.shape, np.inf)
    for block in blocks:
        box = np.ix_(*block.voxels)
        even[box], variance[box], blind[box] = block.even, block.variance, block.blind_mm
    gains = sorted((place for block in blocks for place in block.gains), key=lambda place: -place.gain_nats)
    tissue = prior.tissue_young_kpa * np.exp(even + variance / 2)
    square = tissue**2 * np.exp(variance)
    mean = (1 - probability) * tissue + prior.tissue_young_kpa * first
    spread = np.maximum((1 - probability) * square + prior.tissue_young_kpa**2 * second - mean**2, 0.0)
    sd, length = (np.concatenate([getattr(block.samples, name) for block in blocks]) for name in ("sd", "length_mm"))
    numbers = MapNumbers(
        x_mm=voxels.x_mm,
        y_mm=voxels.y_mm,
        depth_mm=voxels.depth_mm,
        probability=probability,
        area_probability=area_probability(states, voxels),
        area_mm=AREA_MM,
        modulus_kpa=mean,
        modulus_sd_kpa=np.sqrt(spread),
        count_probability=counts / counts.sum(),
        lumps=tuple(lumps),
        unevenness=Estimate(
            samples={
                "sd": _within_cells(sd, field_sds(prior), seed),
                "length_mm": _within_cells(length, LENGTHS_MM, seed),
            },
            prior_sd={"sd": prior.heterogeneity_sd / np.sqrt(12), "length_mm": 5.0},
            prior=str(prior),
        ),
        blind_diameter_mm=blind,
        next_places=tuple(gains[:PLACES]),
    )
    if strain == "small" and scan.kind != "travel_force":
        force_n = float(np.median(observation.force_n))
        load = force_n * MN_PER_N / (prior.tissue_young_kpa * observation.radius_mm**2)
        if load > DEEP:
            young_kpa, percent = prior.tissue_young_kpa, 100 * DEEP_CHANGE * load
            finite_n = FINITE_LOAD * force_n / load
            told = {"force_n": force_n, "young_kpa": young_kpa, "percent": percent, "finite_n": finite_n}
            findings.append(PRESSES_DEEP.finding(**told))
    findings += _findings(
        observation, blocks, states, lumps, prior, blind, voxels, sd, len(scan.presses) + len(scan.left_out)
    )
    flags = tuple(flag for flag, _ in findings)
    shift = np.zeros((len(observation.values), 2))
    for block in blocks:
        inside = np.isin(observation.index, block.index)
        shift[inside] = block.shift_mm
    return LumpMap(
        untrusted=numbers,
        trusted=not UNTRUSTED_MAP_FLAGS.intersection(flags),
        flags=flags,
        notes=tuple(note for _, note in findings),
        left_out=observation.left_out,
        places_mm=observation.places_mm,
        place_shift_mm=shift,
        provenance={
            "notice": RESEARCH_USE_ONLY,
            "tsis": __version__,
            "method": "spheres in uneven tissue by reversible jump; kernel of first order corrected by exact presses",
            "scan": scan.name,
            "kind": scan.kind,
            "presses": len(observation.values),
            "blocks": len(blocks),
            "prior": asdict(prior),
            "seed": seed,
            "strain": strain,
            "started_from_earlier_map": guides,
        },
    )


def _within_cells(values: Floats, grid: Floats, seed: int) -> Floats:
    """Values of a coarse grid spread evenly over the logarithm within their cells: they are known no better."""
    edges = np.log(np.concatenate([grid[:1], np.sqrt(grid[1:] * grid[:-1]), grid[-1:]]))
    cell = np.abs(np.log(grid) - np.log(values)[:, None]).argmin(axis=1)
    return np.asarray(np.exp(np.random.default_rng([seed, 10**5]).uniform(edges[cell], edges[cell + 1])))


def _axis(axis: Floats) -> Floats:
    count = max(2, int(np.ceil((axis[-1] - axis[0]) / BLIND_STEP_MM)) + 1)
    return np.linspace(axis[0], axis[-1] + 1e-9 * (len(axis) == 1), count)


def _findings(
    observation: Observation,
    blocks: list[Block],
    states: tuple[Floats, ...],
    lumps: list[Lump],
    prior: MapPrior,
    blind: Floats,
    voxels: Voxels,
    sd: Floats,
    presses: int,
) -> list[Finding]:
    found = []
    if observation.left_out:
        found.append(
            PRESSES_LEFT_OUT.finding(
                count=len(observation.left_out), all_presses=presses, reasons=first_few(observation.left_out)
            )
        )
    means = [lump.estimate.untrusted.mean for lump in lumps]
    for lump, mean in zip(lumps, means, strict=True):
        if mean["depth_mm"] < SHALLOW_MM:
            found.append(LUMP_SHALLOW.finding(lump=lump.name, depth_mm=mean["depth_mm"]))
    for number, (lump, mean) in enumerate(zip(lumps, means, strict=True)):
        for other, there in zip(lumps[:number], means[:number], strict=True):
            gap = float(
                np.linalg.norm([mean[key] - there[key] for key in ("x_mm", "y_mm", "centre_depth_mm")])
                - (mean["diameter_mm"] + there["diameter_mm"]) / 2
            )
            if gap < NARROW_MM:
                found.append(LUMPS_CLOSE.finding(lump=lump.name, other=other.name, gap_mm=max(gap, 0.0)))
    inner = [
        np.flatnonzero((axis >= observation.places_mm[:, k].min()) & (axis <= observation.places_mm[:, k].max()))
        for k, axis in ((1, voxels.y_mm), (0, voxels.x_mm))
    ]
    if len(inner[0]) and len(inner[1]):
        level = int(np.abs(voxels.depth_mm - TYPICAL_TOP_MM).argmin())
        hidden = float((blind[level][np.ix_(*inner)] > TYPICAL_SIZE_MM).mean())
        if hidden > LARGE_BLIND:
            found.append(
                NOT_COVERED.finding(percent=100 * hidden, diameter_mm=TYPICAL_SIZE_MM, depth_mm=TYPICAL_TOP_MM)
            )
    if np.mean(sd > PRIORS_END * prior.heterogeneity_sd) > AT_END:
        found.append(UNEVEN_AT_END.finding(end=prior.heterogeneity_sd))
    if _unsettled(states):
        found.append(SAMPLER_NOT_SETTLED.finding())
    worst = max(blocks, key=lambda block: block.misfit)
    chance = float(scipy.stats.chi2.sf(worst.misfit / HARD_MISFIT * worst.numbers, worst.numbers))
    if chance < IMPROBABLE:
        found.append(MAP_DOES_NOT_FIT.finding(chance=probability_bound(chance)))
    return found


def _unsettled(states: tuple[Floats, ...]) -> bool:
    """Whether the two halves of the sampling differ in the number of lumps."""
    counts = np.array([len(lumps) for lumps in states])
    halves = [np.bincount(half, minlength=int(counts.max()) + 1) / len(half) for half in np.array_split(counts, 2)]
    return bool(np.abs(halves[0] - halves[1]).max() > UNSETTLED)
