"""The plan of a sweep, as TOML."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from tsis.__about__ import LARGEST_SEED
from tsis.catalog.probes import load_probe
from tsis.errors import InputError
from tsis.files.reading import parse_toml, read_parsed
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.probe import Layer, Probe
from tsis.model.require import require_number, require_one_of, require_type

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """A range that is sampled evenly, or evenly in the logarithm.

    Parameters
    ----------
    low, high
        Ends of the range, in the quantity's unit; ``low < high``.
    logarithmic
        Sample the logarithm evenly; then ``low`` must be positive.

    Raises
    ------
    InputError
        When the ends are in the wrong order, or a logarithm does not exist.

    Examples
    --------
    >>> Range(low=10.0, high=1000.0, logarithmic=True).at(np.array([0.0, 0.5, 1.0])).round(9).tolist()
    [10.0, 100.0, 1000.0]
    """

    low: float
    high: float
    logarithmic: bool = False

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise InputError(
                f"a range must be [low, high] with low < high; got [{self.low:g}, {self.high:g}] "
                "(give one number to keep a value)"
            )
        if self.logarithmic and self.low <= 0:
            raise InputError(f"a logarithmic range must start above 0; got [{self.low:g}, {self.high:g}]")

    def at(self, unit: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at ``unit`` in [0, 1], never outside the range."""
        if self.logarithmic:
            values = self.low * (self.high / self.low) ** unit
        else:
            values = self.low + (self.high - self.low) * unit
        return np.clip(values, self.low, self.high)


Quantity: TypeAlias = float | Range | tuple[float, ...]


def extremes(quantity: Quantity) -> tuple[float, float]:
    """Smallest and largest value of a quantity."""
    if isinstance(quantity, Range):
        return quantity.low, quantity.high
    if isinstance(quantity, tuple):
        return min(quantity), max(quantity)
    return quantity, quantity


TISSUE = ("tissue_young_kpa", "thickness_mm", "poisson")
INCLUSION = ("diameter_mm", "depth_mm", "young_kpa")
QUANTITIES = (*TISSUE, *INCLUSION, "inclusion_poisson")
DEFAULT_POISSON = 0.49

SCALARS = ("approach_mm",)
PROFILES = ("face_displacement_mm", "pressure_kpa", "change_by_inclusion_mm")
COLUMNS = (*SCALARS, *PROFILES)

SAMPLINGS = ("sobol", "latin-hypercube", "random", "grid")
MODELS = ("small", "finite")
UNFIT = ("refuse", "keep")

LARGEST_PRESSES = 10_000_000
LARGEST_LATIN = 1_000_000  # a hypercube is drawn at once, the others in pieces
LARGEST_BATCH = 10_000
LARGEST_SHARDS = 100_000  # in one folder
LARGEST_RADII = 250
LARGEST_FORCES = 100
DEFAULT_RADII = 25


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Everything that determines the bytes of a data set, apart from the libraries.

    Parameters
    ----------
    probe
        The probe.
    quantities
        By name, of `QUANTITIES`: a number is the same for all presses, a `Range` is sampled, a tuple lists values of
        a grid. ``tissue_young_kpa`` and ``thickness_mm`` are required; ``diameter_mm``, ``depth_mm`` and
        ``young_kpa`` of the inclusion are given together, or omitted for tissue without inclusion. ``poisson`` is the
        tissue's.
    forces_n
        Forces on every phantom, N.
    sample
        ``"sobol"``, ``"latin-hypercube"``, ``"random"`` or ``"grid"``.
    count
        Number of phantoms; None for a grid, which has a phantom for each combination.
    seed
        Seed of the sampling; None for a grid.
    strain
        Model of the press, as in `tsis.mechanics.press`.
    batch
        Phantoms in one file of the data set.
    unfit
        For an inclusion that may not fit into the slab: ``"refuse"`` the plan, or ``"keep"`` such phantoms as rows
        with an error and no numbers.
    radii_mm
        Radii on the face of the profiles, mm, ascending; empty for 25 radii from the axis to the edge.
    columns
        Outputs of each press, of `COLUMNS`.

    Raises
    ------
    InputError
        When a value lies outside its range, or the values contradict each other.
    """

    probe: Probe
    quantities: Mapping[str, Quantity]
    forces_n: tuple[float, ...] = (1.0,)
    sample: str = "sobol"
    count: int | None = None
    seed: int | None = None
    strain: str = "small"
    batch: int = 100
    unfit: str = "refuse"
    radii_mm: tuple[float, ...] = ()
    columns: tuple[str, ...] = ("approach_mm", "face_displacement_mm", "pressure_kpa")
    _samples: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_type("probe", self.probe, Probe)
        for name, value, choices in (
            ("sample", self.sample, SAMPLINGS),
            ("strain", self.strain, MODELS),
            ("unfit", self.unfit, UNFIT),
        ):
            if value not in choices:
                raise InputError(f"{name} must be one of {', '.join(choices)}; got {value!r:.80}")
        object.__setattr__(self, "forces_n", _numbers("forces_n", self.forces_n, 0.0, 50.0, LARGEST_FORCES))
        object.__setattr__(self, "quantities", _checked_quantities(self.quantities))
        object.__setattr__(self, "radii_mm", self._checked_radii())
        object.__setattr__(self, "columns", _checked_columns(self.columns, has_inclusion=self.has_inclusion))
        _whole("batch", self.batch, 1, LARGEST_BATCH)
        object.__setattr__(self, "_samples", self._grid() if self.sample == "grid" else self._sampled())
        self._check_size()
        self._check_phantoms()

    @property
    def has_inclusion(self) -> bool:
        """False for tissue without inclusion."""
        return "diameter_mm" in self.quantities

    @property
    def samples(self) -> int:
        """Number of phantoms."""
        return self._samples

    @property
    def presses(self) -> int:
        """Number of presses: phantoms times forces."""
        return self.samples * len(self.forces_n)

    @property
    def shards(self) -> int:
        """Number of files of the data set."""
        return -(-self.samples // self.batch)

    @property
    def sampled(self) -> tuple[str, ...]:
        """Names of the sampled quantities, in the order of the dimensions."""
        return tuple(name for name, value in self.quantities.items() if isinstance(value, Range))

    def phantom(self, values: Mapping[str, float]) -> Phantom:
        """The phantom of one sample."""
        inclusion = None
        if self.has_inclusion:
            lump: dict[str, Any] = {name: values[name] for name in INCLUSION}
            inclusion = Inclusion(**lump, poisson=values["inclusion_poisson"])
        return Phantom(
            young_kpa=values["tissue_young_kpa"],
            thickness_mm=values["thickness_mm"],
            poisson=values["poisson"],
            inclusion=inclusion,
        )

    def _grid(self) -> int:
        if self.count is not None or self.seed is not None:
            raise InputError("count and seed must be left out of a grid, which has a phantom for each combination")
        if self.sampled:
            raise InputError(
                f"a grid must have numbers and lists only; got a range for {self.sampled[0]} "
                "(list its values under [grid], or choose another sample)"
            )
        return math.prod(len(value) for value in self.quantities.values() if isinstance(value, tuple))

    def _sampled(self) -> int:
        lists = [name for name, value in self.quantities.items() if isinstance(value, tuple)]
        if lists:
            raise InputError(f"{lists[0]} must be a number or a range when sample is {self.sample!r}; got a list")
        if not self.sampled:
            raise InputError(
                "at least one quantity must be a range [low, high]; got numbers alone (use sample = 'grid')"
            )
        if self.count is None or self.seed is None:
            raise InputError(f"count and seed must be given when sample is {self.sample!r}")
        _whole("seed", self.seed, 0, LARGEST_SEED)
        largest = LARGEST_LATIN if self.sample == "latin-hypercube" else LARGEST_PRESSES
        return _whole("count", self.count, 1, largest)

    def _checked_radii(self) -> tuple[float, ...]:
        if not self.radii_mm:
            return tuple(np.linspace(0.0, self.probe.radius_mm, DEFAULT_RADII).tolist())
        radii = _numbers("radii_mm", self.radii_mm, 0.0, self.probe.radius_mm, LARGEST_RADII)
        if any(second <= first for first, second in pairwise(radii)):
            raise InputError(f"radii_mm must ascend; got {list(radii)!r:.80}")
        return radii

    def _check_size(self) -> None:
        if self.presses > LARGEST_PRESSES:
            raise InputError(
                f"a sweep must have at most {LARGEST_PRESSES} presses; got {self.samples} phantoms "
                f"x {len(self.forces_n)} forces (split it)"
            )
        if self.shards > LARGEST_SHARDS:
            raise InputError(
                f"a sweep must fit into {LARGEST_SHARDS} files; got {self.shards} "
                f"(set batch to at least {-(-self.samples // LARGEST_SHARDS)})"
            )
        if self.batch * len(self.forces_n) > LARGEST_BATCH:
            raise InputError(
                f"a file must hold at most {LARGEST_BATCH} presses; "
                f"got batch = {self.batch} x {len(self.forces_n)} forces"
            )

    def _check_phantoms(self) -> None:
        """Build the phantoms at the ends of the quantities; all values between lie in the same intervals."""
        ends = {name: extremes(value) for name, value in self.quantities.items()}
        if not self.has_inclusion:
            for k in (0, 1):
                self.phantom({name: end[k] for name, end in ends.items()})
            return
        thinnest, thickest = ends["thickness_mm"]
        # First each end separately; then whether the inclusion fits.
        for k in (0, 1):
            values = {name: end[k] for name, end in ends.items()}
            self.phantom({**values, "diameter_mm": 0.1, "depth_mm": 0.2})
            Inclusion(diameter_mm=values["diameter_mm"], depth_mm=values["depth_mm"], young_kpa=values["young_kpa"])
        shallowest, deepest = (ends["depth_mm"][k] + ends["diameter_mm"][k] for k in (0, 1))
        if shallowest >= thickest:
            raise InputError(
                f"depth_mm + diameter_mm must be less than thickness_mm = {thickest:g} for some phantom; "
                f"got at least {shallowest:g}"
            )
        if self.unfit == "refuse" and deepest >= thinnest:
            raise InputError(
                f"depth_mm + diameter_mm must be less than thickness_mm = {thinnest:g} for every phantom; "
                f"got up to {deepest:g} (narrow a range, or set unfit = 'keep' for rows that hold an error)"
            )


def _checked_quantities(quantities: Mapping[str, Quantity]) -> dict[str, Quantity]:
    checked = {
        require_one_of("quantity", name, QUANTITIES): _checked(name, value) for name, value in quantities.items()
    }
    missing = [name for name in ("tissue_young_kpa", "thickness_mm") if name not in checked]
    of_inclusion = [name for name in INCLUSION if name in checked]
    if of_inclusion:
        missing += [name for name in INCLUSION if name not in checked]
    if missing:
        raise InputError(f"a plan must give {', '.join(missing)}; got {', '.join(checked) or 'nothing'}")
    if "inclusion_poisson" in checked and not of_inclusion:
        raise InputError("inclusion_poisson must be left out for plain tissue; got it without diameter_mm")
    checked.setdefault("poisson", DEFAULT_POISSON)
    if of_inclusion:
        checked.setdefault("inclusion_poisson", DEFAULT_POISSON)
    return {name: checked[name] for name in QUANTITIES if name in checked}


def _checked(name: str, value: Any) -> Quantity:
    if isinstance(value, Range):
        for end in (value.low, value.high):
            require_number(name, end, 0.0, 1e6)
        return value
    if isinstance(value, tuple):
        return _numbers(name, value, 0.0, 1e6, LARGEST_PRESSES)
    return require_number(name, value, 0.0, 1e6)


def _checked_columns(columns: Any, *, has_inclusion: bool) -> tuple[str, ...]:
    if not isinstance(columns, (tuple, list)) or not columns:
        raise InputError(f"columns must be a list of names ({', '.join(COLUMNS)}); got {columns!r:.80}")
    chosen = {require_one_of("column", name, COLUMNS) for name in columns}
    if "change_by_inclusion_mm" in chosen and not has_inclusion:
        raise InputError("change_by_inclusion_mm must be left out of columns for plain tissue, where nothing changes")
    return tuple(name for name in COLUMNS if name in chosen)


def _numbers(name: str, values: Any, low: float, high: float, most: int) -> tuple[float, ...]:
    if not isinstance(values, (tuple, list)) or not 0 < len(values) <= most:
        got = f"{len(values)}" if isinstance(values, (tuple, list)) else f"{values!r:.80}"
        raise InputError(f"{name} must be a list of 1 to {most} numbers; got {got}")
    numbers = tuple(require_number(name, value, low, high) for value in values)
    if len(set(numbers)) < len(numbers):
        raise InputError(f"{name} must not repeat a value; got {list(values)!r:.80}")
    return numbers


def _whole(name: str, value: Any, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise InputError(f"{name} must be a whole number in [{low}, {high}]; got {value!r:.80}")
    return value


LARGEST_PLAN_BYTES = 256 * 2**10
_KEYS = ("forces_n", "strain", "sample", "count", "seed", "batch", "unfit")
KEYS = ("probe", *_KEYS, "logarithmic", "ranges", "grid", "outputs")
OUTPUTS = ("radii_mm", "columns")

EXAMPLE = """\
# A plan of a sweep: press a probe on many phantoms. Start it with: tsis sweep run plan.toml --out data
probe = "tsis-2011"        # a name of the catalog, or a table: [probe] radius_mm = ..., layers = [{thickness_mm = ...}]
forces_n = [1.0]           # every phantom is pressed with each of these
strain = "small"

sample = "sobol"           # or "latin-hypercube", "random", "grid"
count = 1024               # phantoms; Sobol' points are most even at powers of two
seed = 1
batch = 64                 # phantoms in one file
unfit = "refuse"           # or "keep": an inclusion that does not fit is a row with an error
logarithmic = ["young_kpa"]  # ranges that are sampled evenly in the logarithm

[ranges]                   # a number is the same for all phantoms, [low, high] is sampled
diameter_mm = [4.0, 12.0]
depth_mm = [6.0, 16.0]     # from the skin to the top of the inclusion
young_kpa = [20.0, 500.0]
tissue_young_kpa = 5.0
thickness_mm = 40.0
poisson = 0.49             # of the tissue; inclusion_poisson is that of the inclusion

# [grid]                   # with sample = "grid": every combination of these lists
# depth_mm = [6.0, 8.0, 12.0]

[outputs]
radii_mm = [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]
columns = ["approach_mm", "face_displacement_mm", "pressure_kpa"]  # also "change_by_inclusion_mm"
"""


def load_plan(path: str | os.PathLike[str]) -> Plan:
    """Read a plan from a TOML file.

    Raises
    ------
    FileInputError
        When the file is missing, no TOML, or a value is invalid.
    """
    return read_parsed(Path(path), parse_plan_text, most=LARGEST_PLAN_BYTES)


def parse_plan_text(text: str) -> Plan:
    """Read a plan from the text of a TOML file.

    Raises
    ------
    InputError
        When the text is no TOML, or a value is invalid.

    Examples
    --------
    >>> plan = parse_plan_text(EXAMPLE)
    >>> plan.presses, plan.shards, plan.sampled
    (1024, 16, ('diameter_mm', 'depth_mm', 'young_kpa'))
    """
    return plan_from_document(parse_toml(text, what="a plan"))


def plan_from_document(document: Mapping[str, Any]) -> Plan:
    """The plan in a document: the tables of a TOML file, or the result of `plan_document`.

    `InputError` when it has an unknown key or an invalid value.
    """
    for key in document:
        require_one_of("key of a plan", key, KEYS)
    if "probe" not in document:
        raise InputError('a plan must name its probe; got none (probe = "tsis-2011", say)')
    outputs = _table("outputs", document.get("outputs", {}))
    for key in outputs:
        require_one_of("key of [outputs]", key, OUTPUTS)
    arguments = {key: _tuple(document[key]) for key in document if key in _KEYS}
    arguments |= {key: _tuple(value) for key, value in outputs.items()}
    return Plan(probe=_probe(document["probe"]), quantities=_quantities(document), **arguments)


def plan_document(plan: Plan) -> dict[str, Any]:
    """A plan as JSON values, with the probe's values: equal plans give equal documents."""
    probe = plan.probe
    ranges = {name: value for name, value in plan.quantities.items() if not isinstance(value, tuple)}
    document: dict[str, Any] = {
        "probe": {
            "name": probe.name,
            "radius_mm": float(probe.radius_mm),
            "sides": probe.sides,
            "layers": [{name: float(value) for name, value in asdict(layer).items()} for layer in probe.layers],
        },
        "forces_n": list(plan.forces_n),
        "strain": plan.strain,
        "sample": plan.sample,
        "batch": plan.batch,
        "unfit": plan.unfit,
        "ranges": {
            name: [value.low, value.high] if isinstance(value, Range) else value for name, value in ranges.items()
        },
        "outputs": {"radii_mm": list(plan.radii_mm), "columns": list(plan.columns)},
    }
    if probe.face_curvature_mm is not None:
        document["probe"]["face_curvature_mm"] = float(probe.face_curvature_mm)
    if plan.sample == "grid":
        document["grid"] = {name: list(value) for name, value in plan.quantities.items() if isinstance(value, tuple)}
    else:
        document |= {"count": plan.count, "seed": plan.seed}
        document["logarithmic"] = [
            name for name, value in ranges.items() if isinstance(value, Range) and value.logarithmic
        ]
    return document


_PROBE_KEYS = ("name", "radius_mm", "layers", "face_curvature_mm", "sides")


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _table(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{name} must be a table, [{name}]; got {value!r:.80}")
    return value


def _quantities(document: Mapping[str, Any]) -> dict[str, Quantity]:
    ranges, grid = (_table(name, document.get(name, {})) for name in ("ranges", "grid"))
    both = sorted(set(ranges) & set(grid))
    if both:
        raise InputError(f"{both[0]} must stand under [ranges] or [grid]; got both")
    logarithmic = document.get("logarithmic", [])
    if not isinstance(logarithmic, list):
        raise InputError(f"logarithmic must be a list of names; got {logarithmic!r:.80}")
    sampled = [name for name, value in ranges.items() if isinstance(value, list)]
    for name in logarithmic:
        if name not in sampled:
            raise InputError(f"logarithmic must name ranges [low, high] of this plan; got {name!r:.80}")
    quantities = {name: _ranged(name, value, logarithmic=name in logarithmic) for name, value in ranges.items()}
    for name, value in grid.items():
        if not isinstance(value, list):
            raise InputError(f"{name} under [grid] must be a list of values; got {value!r:.80} (see [ranges])")
        quantities[name] = tuple(value)
    return quantities


def _ranged(name: str, value: Any, *, logarithmic: bool) -> Quantity:
    if not isinstance(value, list):
        return require_number(name, value, 0.0, 1e6)
    if len(value) != 2:
        raise InputError(f"{name} must be a number or [low, high]; got {value!r:.80} (lists of values go under [grid])")
    low, high = (require_number(name, end, 0.0, 1e6) for end in value)
    try:
        return Range(low=low, high=high, logarithmic=logarithmic)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _probe(value: Any) -> Probe:
    if isinstance(value, str):
        return load_probe(value).unlit()  # the document of a plan has no light
    table = _table("probe", value)
    for key in table:
        require_one_of("key of [probe]", key, _PROBE_KEYS)
    layers = table.get("layers")
    if "radius_mm" not in table or not isinstance(layers, list):
        raise InputError(f"[probe] must give radius_mm and a list of layers; got {', '.join(table) or 'nothing'}")
    return Probe(**{**table, "name": str(table.get("name", "")), "layers": tuple(_layer(layer) for layer in layers)})


def _layer(value: Any) -> Layer:
    table = _table("layers", value)
    known = [field.name for field in fields(Layer)]
    for key in table:
        require_one_of("key of a layer", key, known)
    if not {"thickness_mm", "young_kpa"} <= set(table):
        raise InputError(f"a layer must give thickness_mm and young_kpa; got {', '.join(table) or 'nothing'}")
    return Layer(**table)
