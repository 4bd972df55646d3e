"""Plans as TOML files."""

from __future__ import annotations

from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tsis.catalog import load_probe
from tsis.errors import InputError
from tsis.files import parse_toml, read_parsed
from tsis.model import Layer, Probe, require_number, require_one_of
from tsis.sweep._plan import Plan, Quantity, Range

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping


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
    existing = [item.name for item in fields(Layer)]
    for key in table:
        require_one_of("key of a layer", key, existing)
    if not {"thickness_mm", "young_kpa"} <= set(table):
        raise InputError(f"a layer must give thickness_mm and young_kpa; got {', '.join(table) or 'nothing'}")
    return Layer(**table)
