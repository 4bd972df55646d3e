"""The networks' route from frames to an inclusion (section 6.3).

The source evaluates the whole face. With a flat face and a fixed force the three outputs, greatest value, total and
area, are then nearly equal for all inclusions: the total is the force, the area is the face, and the greatest value is
at the rim. By default the reference press is subtracted and the rim is excluded.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import FileInputError, InputError
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import canonical, digest_or_none
from tsis.files.reading import as_path, printable_path, read_object
from tsis.imaging.profile import radial_profile
from tsis.inclusion.frames import pixels_mm
from tsis.inclusion.network_training import Layers, Network, Span, check_varies, train_repeatedly
from tsis.inclusion.posterior.rings import ring_means
from tsis.inclusion.prior import PARAMETERS, Floats, InclusionPrior
from tsis.mechanics.surrogate.building import build_surrogate
from tsis.mechanics.surrogate.polynomial import PressSurrogate
from tsis.model.calibration import Calibration
from tsis.model.content import ContentValue
from tsis.model.image import as_images, require_frames_of_probe, require_image_series, require_same_probe
from tsis.model.probe import Probe
from tsis.model.require import require_array, require_integer, require_number, require_one_of, require_type

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from tsis.inclusion.prior import Floats
    from tsis.model.image import TactileImage


OUTPUTS = ("greatest", "total", "area")
FIELDS = ("face_displacement_mm", "pressure_kpa")
OUTPUT_RADIUS_MM = 8.0  # beyond it the rim of a 12 mm face is brighter than the inclusion
RINGS = 20
MOST_RINGS = 1000
CHUNK = 4096  # profiles refined at a time: 26 MB with the usual rings
BRIGHTEST = 0.999  # of saturation, the limit of the inverse response
FINE = 40  # radii per ring that resolve the area's outline to 0.3 % of its radius
CHANGED_FRACTION = 0.05  # of the reference's mean: a change that counts as deformed, above errors of force
PRESSED_FRACTION = 0.5  # of the reference's mean: level that counts as deformed without subtraction


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputReading:
    """Definition of the three outputs of ring profiles; created by `change_reading` or `printed_reading`.

    Attributes
    ----------
    edges_mm
        Ring boundaries on the face, shape (rings + 1,).
    subtract
        Whether the reference press is subtracted.
    threshold_share
        Level above which the face counts as deformed, over the mean level of the reference, in [1e-6, 10].
    """

    edges_mm: Floats
    subtract: bool
    threshold_share: float

    def __post_init__(self) -> None:
        edges = require_array("edges_mm", self.edges_mm, ndim=1)
        if not 3 <= len(edges) <= MOST_RINGS + 1 or edges[0] < 0 or (np.diff(edges) <= 0).any():
            raise InputError(
                f"edges_mm must be 3 to {MOST_RINGS + 1} ascending radii, the first >= 0; "
                f"got {len(edges)} from {edges[0]:g} to {edges[-1]:g}"
            )
        object.__setattr__(self, "edges_mm", edges)
        require_number("threshold_share", self.threshold_share, 1e-6, 10.0)

    def __call__(self, profiles: ArrayLike, reference: ArrayLike) -> Floats:
        """Greatest, total and area (mm²), shape (n, 3), of profiles (n, rings) beside that of plain tissue (rings,)."""
        values, base = require_array("profiles", profiles, ndim=2), require_array("reference", reference, ndim=1)
        rings = len(self.edges_mm) - 1
        if values.shape[1] != rings or base.shape != (rings,):
            raise InputError(f"profiles and reference must have {rings} rings; got {values.shape} and {base.shape}")
        area = np.pi * np.diff(self.edges_mm**2)
        level = self.threshold_share * float(base @ area) / float(area.sum())
        if self.subtract:
            values = values - base
        return np.column_stack([values.max(axis=1), values @ area, self._area_above(values, level)])

    def _area_above(self, values: Floats, level: float) -> Floats:
        """Area where profiles exceed a level, from parabolas through the ring means."""
        middles = np.sqrt((self.edges_mm[1:] ** 2 + self.edges_mm[:-1] ** 2) / 2)
        ends = np.linspace(self.edges_mm[0], self.edges_mm[-1], FINE * len(middles) + 1)
        inside = np.clip((ends[1:] + ends[:-1]) / 2, middles[0], middles[-1])
        area = np.pi * np.diff(ends**2)
        parts = np.array_split(values, len(values) // CHUNK + 1)
        return np.concatenate(
            [(scipy.interpolate.PchipInterpolator(middles, part, axis=1)(inside) > level) @ area for part in parts]
        )


def change_reading(
    *, extent_mm: float = OUTPUT_RADIUS_MM, threshold_fraction: float = CHANGED_FRACTION
) -> OutputReading:
    """Outputs of the change against the reference, without the rim.

    Parameters
    ----------
    extent_mm
        Radius on the face, mm, in [0.1, 200].
    threshold_fraction
        Change that counts as deformed, over the reference's mean.

    Raises
    ------
    InputError
        When a number lies outside its range.
    """
    extent = require_number("extent_mm", extent_mm, 0.1, 200.0, hint="millimetres")
    return OutputReading(
        edges_mm=np.linspace(0.0, extent, RINGS + 1), subtract=True, threshold_share=threshold_fraction
    )


def printed_reading(probe: Probe, *, threshold_fraction: float = PRESSED_FRACTION) -> OutputReading:
    """Outputs of the whole face without subtraction, as in section 6.3.

    Parameters
    ----------
    probe
        The probe, whose face is evaluated from the axis to the rim.
    threshold_fraction
        Grey level that counts as deformed, over the reference's mean.

    Raises
    ------
    InputError
        When ``probe`` is no `Probe`, or the fraction is out of range.
    """
    require_type("probe", probe, Probe)
    edges = np.linspace(0.0, probe.radius_mm, RINGS + 1)
    return OutputReading(edges_mm=edges, subtract=False, threshold_share=threshold_fraction)


def simulated_outputs(
    surrogate: PressSurrogate,
    inclusions: ArrayLike,
    reading: OutputReading,
    *,
    field: str = "face_displacement_mm",
    tissue_young_kpa: float = 5.0,
    thickness_mm: float = 30.0,
) -> Floats:
    """The three outputs of simulated presses; section 6.3.1.

    Parameters
    ----------
    surrogate
        Presses of the probe at one force.
    inclusions
        Diameter (mm), depth (mm) and modulus (kPa) of each, shape (n, 3), inside the surrogate's box.
    reading
        Definition of the outputs.
    field
        ``"face_displacement_mm"`` as in the source, or ``"pressure_kpa"``, which a camera measures.
    tissue_young_kpa, thickness_mm
        The slab around the inclusion, inside the surrogate's box.

    Returns
    -------
    Outputs of shape (n, 3): mm, mm³ and mm², or kPa, mN and mm².

    Raises
    ------
    InputError
        When a value is outside the surrogate's box or the reading extends beyond the face.
    UnknownNameError
        When the field is unknown.
    """
    require_type("surrogate", surrogate, PressSurrogate)
    require_type("reading", reading, OutputReading)
    require_one_of("field", field, FIELDS)
    table, box = require_array("inclusions", inclusions, ndim=2), surrogate.pressure_kpa.box
    if table.shape[1] != len(PARAMETERS):
        raise InputError(f"inclusions must have the columns {', '.join(PARAMETERS)}; got shape {table.shape}")
    for name, column in zip(PARAMETERS, table.T, strict=True):
        for end in (column.min(), column.max()):
            require_number(name, float(end), *getattr(box, name), hint="the surrogate's box")
    require_number("tissue_young_kpa", tissue_young_kpa, *box.tissue_young_kpa, hint="the surrogate's box")
    require_number("thickness_mm", thickness_mm, *box.thickness_mm, hint="the surrogate's box")
    require_number(
        "the reading's extent", reading.edges_mm[-1], 0.0, float(surrogate.radius_mm[-1]), hint="the face, mm"
    )
    rings = getattr(surrogate, field).mapped(ring_means(surrogate.radius_mm, reading.edges_mm))
    at = rings.at_tissue(tissue_young_kpa, thickness_mm)
    return reading(at(*table.T), at.baseline)


def printed_frame_outputs(images: TactileImage | Sequence[TactileImage], *, threshold_grey: float) -> Floats:
    """The outputs as section 6.3.2 prints them, of raw frames.

    Parameters
    ----------
    images
        Frames of the pressed probe.
    threshold_grey
        Grey level above which a pixel counts as deformed, in [0, 65535]; the source's k, which it does not give.

    Returns
    -------
    Grey level at the centroid, sum of grey levels, and number of pixels above the threshold; shape (n, 3).

    Raises
    ------
    InputError
        When there is no frame, or a frame is dark and has no centroid.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> printed_frame_outputs(TactileImage(grey=[[0.0, 2.0, 0.0], [2.0, 9.0, 2.0]]), threshold_grey=5.0).tolist()
    [[9.0, 15.0, 1.0]]
    """
    threshold = require_number("threshold_grey", threshold_grey, 0.0, 65535.0, hint="grey levels")
    frames = as_images("images", images)
    if not frames:
        raise InputError("images must hold a frame at least; got none")
    return np.array([_printed(frame, threshold) for frame in frames])


def _printed(frame: TactileImage, threshold: float) -> tuple[float, float, float]:
    grey, total = frame.grey, float(frame.grey.sum())
    if not total > 0:
        raise InputError(f"every frame must hold light; {frame.name or 'an image'!r} sums to {total:g} grey levels")
    rows, columns = np.indices(grey.shape)
    row, column = round(float((rows * grey).sum()) / total), round(float((columns * grey).sum()) / total)
    row, column = min(max(row, 0), grey.shape[0] - 1), min(max(column, 0), grey.shape[1] - 1)  # negative noise
    return float(grey[row, column]), total, float(np.count_nonzero(grey > threshold))


def frame_outputs(
    images: TactileImage | Sequence[TactileImage],
    reference: TactileImage,
    reading: OutputReading,
    *,
    calibration: Calibration,
) -> Floats:
    """The three outputs of frames, in grey levels at uniform light; section 6.3.2.

    Parameters
    ----------
    images
        Frames of the pressed probe over inclusions, of known force and scale.
    reference
        Reference press of the same force.
    reading
        Definition of the outputs.
    calibration
        Background and light map.

    Returns
    -------
    Outputs of shape (n, 3): grey levels, grey levels times mm², and mm².

    Raises
    ------
    InputError
        When a force or scale is unknown, forces differ, or a ring is outside the picture or completely clipped.
    ImageMismatchError
        When the frames differ in size, scale or axis.
    """
    rings = _rings_of_frames(images, reference, reading, calibration)
    return reading(rings[:-1], rings[-1])


def pressure_outputs(
    images: TactileImage | Sequence[TactileImage],
    reference: TactileImage,
    reading: OutputReading,
    *,
    calibration: Calibration,
) -> Floats:
    """The three outputs of frames in the units of the simulated pressure, by the response of the calibration.

    Parameters
    ----------
    images, reference, reading, calibration
        As for `frame_outputs`.

    Returns
    -------
    Outputs of shape (n, 3): kPa, mN and mm², as `simulated_outputs` has them of ``"pressure_kpa"``.

    Raises
    ------
    InputError, ImageMismatchError
        As `frame_outputs`.
    """
    grey = _rings_of_frames(images, reference, reading, calibration)
    fraction = grey / (calibration.gain_grey_per_kpa * calibration.saturation_kpa)
    slope = np.sqrt(np.pi) / 2.0  # of the error function's argument, so that the gain is the slope at no pressure
    rings = calibration.saturation_kpa / slope * scipy.special.erfinv(np.clip(fraction, -BRIGHTEST, BRIGHTEST))
    return reading(rings[:-1], rings[-1])


def _rings_of_frames(
    images: TactileImage | Sequence[TactileImage],
    reference: TactileImage,
    reading: OutputReading,
    calibration: Calibration,
) -> Floats:
    """Ring means in grey levels at uniform light of each frame, the reference last; shape (n + 1, rings)."""
    require_type("calibration", calibration, Calibration)
    require_type("reading", reading, OutputReading)
    frames = [*as_images("images", images), *as_images("reference", reference)]
    if len(frames) < 2:
        raise InputError(f"images must hold a frame at least, beside the reference; got {len(frames) - 1}")
    require_image_series(frames)
    forces = {frame.force_n for frame in frames}
    if len(forces) > 1:
        raise InputError(f"force_n must be the same for all frames; got {sorted(str(force) for force in forces)}")
    rings = np.array([_ring_means(frame, reading.edges_mm, calibration) for frame in frames])
    unseen = int(np.isnan(rings).any(axis=0).sum())
    if unseen:
        raise InputError(
            f"every ring to {reading.edges_mm[-1]:g} mm must have lit pixels in the picture that are not clipped; "
            f"got {unseen} of {rings.shape[1]} rings without (lower the exposure or the extent)"
        )
    return rings


def _ring_means(frame: TactileImage, edges_mm: Floats, calibration: Calibration) -> Floats:
    """Mean grey above the background in rings, at uniform light; NaN in rings without usable pixels.

    Clipped pixels are excluded, since the press is round. The sum of grey over the sum of light is, with photon noise,
    the best mean.
    """
    light: NDArray[np.floating[Any]] = np.ones(frame.grey.shape)
    if calibration.light is not None:
        light = calibration.light.at(*pixels_mm(frame))
    clipped = frame.grey >= frame.full_scale
    lit = replace(frame, grey=np.where(clipped, frame.full_scale, light))  # excludes the same pixels
    observed, light_there = (radial_profile(each, edges_mm=edges_mm).mean_grey for each in (frame, lit))
    return np.asarray((observed - calibration.background_grey) / np.where(light_there > 0, light_there, np.nan))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearMapping:
    """Straight lines from measured to simulated outputs, one per column.

    Attributes
    ----------
    slope, intercept
        Of each output, shape (outputs,).
    r_squared
        Fraction of the simulated outputs' variance explained by the lines, shape (outputs,).
    """

    slope: Floats
    intercept: Floats
    r_squared: Floats

    def __call__(self, measured: ArrayLike) -> Floats:
        """Simulated outputs for measured ones, shape (n, outputs)."""
        return np.asarray(self.intercept + self.slope * require_array("measured", measured, ndim=2))


def fit_mapping(measured: ArrayLike, simulated: ArrayLike) -> LinearMapping:
    """Fit lines through known inclusions by least squares.

    Parameters
    ----------
    measured, simulated
        Outputs of the same inclusions from frames and from the simulation, shapes (n, outputs), n at least 2.

    Raises
    ------
    InputError
        When the tables do not fit together, or an output is the same for all inclusions.

    Examples
    --------
    >>> mapping = fit_mapping([[1.0], [2.0], [4.0]], [[5.0], [7.0], [11.0]])
    >>> mapping([[3.0]]).round(6).tolist(), mapping.r_squared.round(6).tolist()
    ([[9.0]], [1.0])
    """
    x, y = require_array("measured", measured, ndim=2), require_array("simulated", simulated, ndim=2)
    if x.shape != y.shape or len(x) < 2:
        raise InputError(f"measured and simulated must have one shape, two rows or more; got {x.shape} and {y.shape}")
    check_varies("measured", x)
    check_varies("simulated", y)
    x_deviation, y_deviation = x - x.mean(axis=0), y - y.mean(axis=0)
    slope = (x_deviation * y_deviation).sum(axis=0) / (x_deviation**2).sum(axis=0)
    left = ((y_deviation - slope * x_deviation) ** 2).sum(axis=0)
    return LinearMapping(
        slope=slope,
        intercept=y.mean(axis=0) - slope * x.mean(axis=0),
        r_squared=1.0 - left / (y_deviation**2).sum(axis=0),
    )


def leave_one_out_mapping(measured: ArrayLike, simulated: ArrayLike) -> Floats:
    """Measured outputs mapped by lines fitted to the other inclusions; shape (n, outputs).

    Parameters
    ----------
    measured, simulated
        Outputs of n >= 3 inclusions by frames and by the model, shape (n, outputs), in the same units.

    Raises
    ------
    InputError
        When the shapes differ, or there are fewer than three inclusions.
    """
    x, y = require_array("measured", measured, ndim=2), require_array("simulated", simulated, ndim=2)
    if x.shape != y.shape or len(x) < 3:
        raise InputError(f"measured and simulated must have one shape, three rows or more; got {x.shape}, {y.shape}")
    others = ~np.eye(len(x), dtype=bool)
    return np.concatenate([fit_mapping(x[fitted], y[fitted])(x[~fitted]) for fitted in others])


FORMAT, VERSION = "tsis networks", 1
LARGEST_BYTES, MOST_VALUES = 32 * 2**20, 2_000_000
MOST_NETWORKS, MOST_SAMPLES = 1000, 100_000
VALIDATED_FRACTION = 9 / 134  # of the samples, as in the source
SAME_FORCE = 0.05  # relative
KEYS = {"format", "version", "notice", "tsis", "probe", "force_n", "reach_mm", "prior", "networks", "sha256"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrainedNetworks(ContentValue):
    """Networks from the three outputs of a press in kPa, mN and mm² to diameter, depth and modulus.

    Attributes
    ----------
    probe
        Name of the probe whose presses were simulated.
    force_n
        Force of these presses, N.
    reach_mm
        Radius of the outputs on the face, mm.
    prior
        Fields of the `InclusionPrior` of the training's inclusions.
    networks
        The networks, with different initial weights and validation samples.
    """

    probe: str
    force_n: float
    reach_mm: float
    prior: Mapping[str, Any]
    networks: tuple[Network, ...]

    @property
    def reading(self) -> OutputReading:
        """Definition of the outputs."""
        return change_reading(extent_mm=self.reach_mm)

    def outputs(
        self, images: Sequence[TactileImage], reference: TactileImage, *, probe: Probe, calibration: Calibration
    ) -> Floats:
        """Greatest pressure (kPa), total (mN) and area (mm²) of frames, shape (n, 3).

        Raises
        ------
        InputError
            When a force is not that of the training within 5 %, and as `frame_outputs`.
        NotCalibratedError
            When the calibration is of another probe.
        ImageMismatchError
            When the settings of a frame name another probe.
        """
        require_same_probe(probe, calibration)
        require_frames_of_probe((*images, reference), probe)
        if probe.name != self.probe:
            raise InputError(f"probe must be {self.probe!r}, for which the networks were trained; got {probe.name!r}")
        for frame in (*images, reference):
            if frame.force_n is not None and abs(frame.force_n - self.force_n) > SAME_FORCE * self.force_n:
                raise InputError(
                    f"force_n must be that of the training, {self.force_n:g} N within {100 * SAME_FORCE:g} %; got "
                    f"{frame.force_n:g} N for {frame.name or 'an image'!r}"
                )
        return pressure_outputs(images, reference, self.reading, calibration=calibration)

    def __call__(self, outputs: Floats) -> Floats:
        """Results of each network for outputs of shape (n, 3): shape (networks, n, 3), in mm, mm and kPa."""
        return np.array([network(outputs) for network in self.networks])

    def outside(self, outputs: Floats) -> tuple[str, ...]:
        """Names of the outputs outside the range of the training in any row."""
        low = np.min([network.input_span.low for network in self.networks], axis=0)
        high = np.max([network.input_span.high for network in self.networks], axis=0)
        beyond = ((outputs < low) | (outputs > high)).any(axis=0)
        return tuple(name for name, is_beyond in zip(OUTPUTS, beyond, strict=True) if is_beyond)


def train_networks(
    probe: Probe,
    *,
    rng: np.random.Generator,
    force_n: float = 1.0,
    prior: InclusionPrior | None = None,
    samples: int = 134,
    networks: int = 100,
    hidden: Sequence[int] = (10,),
    method: str = "scg",
    extent_mm: float = OUTPUT_RADIUS_MM,
    solving: Callable[[int, int], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> TrainedNetworks:
    """Simulate presses on inclusions of the prior, and train networks on their outputs; section 6.3.3.

    Parameters
    ----------
    probe, force_n
        The probe, and its force in N, in [1e-3, 50].
    rng
        Draws inclusions, initial weights and validation samples.
    prior
        Prior of the inclusions and of the slab; `InclusionPrior` by default.
    samples
        Simulated inclusions, in [20, 100000]; the source has 134.
    networks
        Number of networks, in [1, 1000]; the source has 100.
    hidden, method
        As for `train_network`.
    extent_mm
        Radius of the outputs on the face, mm.
    solving, progress
        Called with (slabs solved, slabs) while a new probe's surrogate is built, and with (networks trained, networks).

    Raises
    ------
    InputError, UnknownNameError
        When a value lies outside its range.
    """
    prior = InclusionPrior() if prior is None else prior
    require_type("prior", prior, InclusionPrior)
    require_type("rng", rng, np.random.Generator)
    samples = require_integer("samples", samples, 20, MOST_SAMPLES)
    networks = require_integer("networks", networks, 1, MOST_NETWORKS)
    reading = change_reading(extent_mm=extent_mm)
    surrogate = build_surrogate(probe, prior.box(), force_n=force_n, progress=solving)
    inclusions = rng.uniform(prior.low, prior.high, (samples, len(PARAMETERS)))
    outputs = simulated_outputs(
        surrogate,
        inclusions,
        reading,
        field="pressure_kpa",
        tissue_young_kpa=prior.tissue_young_kpa,
        thickness_mm=prior.thickness_mm,
    )
    found = train_repeatedly(
        outputs,
        inclusions,
        rng=rng,
        networks=networks,
        validated=max(1, round(VALIDATED_FRACTION * samples)),
        hidden=hidden,
        method=method,
        progress=progress,
    )
    return TrainedNetworks(
        probe=probe.name,
        force_n=float(force_n),
        reach_mm=float(extent_mm),
        prior=asdict(prior),
        networks=tuple(found),
    )


def write_networks(trained: TrainedNetworks, path: str | os.PathLike[str]) -> Path:
    """Write networks to a text file atomically; an existing file is replaced.

    Raises
    ------
    FileInputError
        When the file cannot be written.
    """
    require_type("trained", trained, TrainedNetworks)
    file = as_path(path)
    content: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "probe": trained.probe,
        "force_n": trained.force_n,
        "reach_mm": trained.reach_mm,
        "prior": {name: list(value) if isinstance(value, tuple) else value for name, value in trained.prior.items()},
        "networks": [_plain(network) for network in trained.networks],
    }
    try:
        write_durably(file, (canonical(content | {"sha256": digest_or_none(content)}) + "\n").encode())
    except OSError as error:
        raise FileInputError(f"{printable_path(file)} must be writable; got: {error.strerror}") from error
    return file


def _plain(network: Network) -> dict[str, Any]:
    spans = {"input_span": network.input_span, "output_span": network.output_span}
    return {
        "hidden": list(network.layers.hidden),
        "weights": network.weights.tolist(),
        **{name: [span.low.tolist(), span.high.tolist()] for name, span in spans.items()},
    }


def read_networks(path: str | os.PathLike[str]) -> TrainedNetworks:
    """Read a file of `write_networks`; at most 32 MiB.

    Raises
    ------
    FileInputError
        When the file is of another kind, or was changed.
    """
    file = as_path(path)
    content = read_object(file, most=LARGEST_BYTES, values=MOST_VALUES)
    if content.get("format") != FORMAT or content.get("version") != VERSION:
        raise FileInputError(
            f"{printable_path(file)} must be a {FORMAT!r} file of version {VERSION}; got "
            f"{content.get('format')!r:.40} of version {content.get('version')!r:.20}"
        )
    if set(content) != KEYS or digest_or_none({**content, "sha256": None}) != content["sha256"]:
        raise FileInputError(f"{printable_path(file)} must be unchanged; its content does not match its hash")
    try:
        return _trained(content)
    except (InputError, TypeError, ValueError, KeyError, AttributeError) as error:
        raise FileInputError(f"{printable_path(file)} must hold trained networks; it does not") from error


def _trained(content: Mapping[str, Any]) -> TrainedNetworks:
    prior: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in content["prior"].items()
    }
    trained = TrainedNetworks(
        probe=str(content["probe"]),
        force_n=require_number("force_n", content["force_n"], 1e-3, 50.0),
        reach_mm=require_number("reach_mm", content["reach_mm"], 0.1, 200.0),
        prior=asdict(InclusionPrior(**prior)),
        networks=tuple(_network(network) for network in content["networks"]),
    )
    require_integer("networks", len(trained.networks), 1, MOST_NETWORKS)
    return trained


def _network(content: Mapping[str, Any]) -> Network:
    layers = Layers(inputs=len(OUTPUTS), hidden=tuple(content["hidden"]), outputs=len(PARAMETERS))
    weights = require_array("weights", content["weights"], ndim=1)
    if weights.shape != (layers.weights,):
        raise InputError(f"weights must be {layers.weights}; got {weights.size}")
    spans = {}
    for name, size in (("input_span", layers.inputs), ("output_span", layers.outputs)):
        ends = require_array(name, content[name], ndim=2)
        if ends.shape != (2, size) or not (ends[0] < ends[1]).all():
            raise InputError(f"{name} must be {size} ascending ranges")
        spans[name] = Span(low=ends[0], high=ends[1])
    return Network(layers=layers, weights=weights, **spans)
