"""Networks trained for one probe at one force: training, application and file."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import FileInputError, InputError
from tsis.files import as_path, canonical, digest_or_none, printable_path, read_object, write_durably
from tsis.inclusion._prior import PARAMETERS, Floats, InclusionPrior
from tsis.inclusion.network._network import Layers, Network, Span
from tsis.inclusion.network._outputs import (
    OUTPUT_RADIUS_MM,
    OUTPUTS,
    change_reading,
    pressure_outputs,
    simulated_outputs,
)
from tsis.inclusion.network._training import train_repeatedly
from tsis.mechanics.surrogate import build_surrogate
from tsis.model import (
    ContentValue,
    require_array,
    require_frames_of_probe,
    require_integer,
    require_number,
    require_same_probe,
    require_type,
)

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from tsis.inclusion.network._outputs import OutputReading
    from tsis.model import Calibration, Probe, TactileImage


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
    result = train_repeatedly(
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
        probe=probe.name, force_n=float(force_n), reach_mm=float(extent_mm), prior=asdict(prior), networks=tuple(result)
    )


def write_networks(trained: TrainedNetworks, path: str | os.PathLike[str]) -> Path:
    """Write networks to a text file atomically; an existing file is replaced.

    Raises
    ------
    FileInputError
        When the file cannot be written.
    """
    require_type("trained", trained, TrainedNetworks)
    position = as_path(path)
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
        write_durably(position, (canonical(content | {"sha256": digest_or_none(content)}) + "\n").encode())
    except OSError as error:
        raise FileInputError(f"{printable_path(position)} must be writable; got: {error.strerror}") from error
    return position


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
    position = as_path(path)
    content = read_object(position, most=LARGEST_BYTES, values=MOST_VALUES)
    if content.get("format") != FORMAT or content.get("version") != VERSION:
        raise FileInputError(
            f"{printable_path(position)} must be a {FORMAT!r} file of version {VERSION}; got "
            f"{content.get('format')!r:.40} of version {content.get('version')!r:.20}"
        )
    if set(content) != KEYS or digest_or_none({**content, "sha256": None}) != content["sha256"]:
        raise FileInputError(f"{printable_path(position)} must be unchanged; its content does not match its hash")
    try:
        return _trained(content)
    except (InputError, TypeError, ValueError, KeyError, AttributeError) as error:
        raise FileInputError(f"{printable_path(position)} must hold trained networks; it does not") from error


def _trained(content: Mapping[str, Any]) -> TrainedNetworks:
    prior: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in content["prior"].items()
    }
    trained = TrainedNetworks(
        probe=str(content["probe"]),
        force_n=require_number("force_n", content["force_n"], 1e-3, 50.0),
        reach_mm=require_number("reach_mm", content["reach_mm"], 0.1, 200.0),
        prior=asdict(InclusionPrior(**prior)),
        networks=tuple(_network(item) for item in content["networks"]),
    )
    require_integer("networks", len(trained.networks), 1, MOST_NETWORKS)
    return trained


def _network(reference: Mapping[str, Any]) -> Network:
    layers = Layers(inputs=len(OUTPUTS), hidden=tuple(reference["hidden"]), outputs=len(PARAMETERS))
    weights = require_array("weights", reference["weights"], ndim=1)
    if weights.shape != (layers.weights,):
        raise InputError(f"weights must be {layers.weights}; got {weights.size}")
    spans = {}
    for name, size in (("input_span", layers.inputs), ("output_span", layers.outputs)):
        ends = require_array(name, reference[name], ndim=2)
        if ends.shape != (2, size) or not (ends[0] < ends[1]).all():
            raise InputError(f"{name} must be {size} ascending ranges")
        spans[name] = Span(low=ends[0], high=ends[1])
    return Network(layers=layers, weights=weights, **spans)
