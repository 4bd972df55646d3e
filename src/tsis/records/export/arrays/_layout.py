"""Layout of a target record in groups and arrays, for every array file format."""

from __future__ import annotations

import json
import math
import re
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.calibration.file import calibration_bytes
from tsis.errors import RecordsError
from tsis.files import to_json_value
from tsis.model import INTERVAL_LEVEL, unit_of
from tsis.records._estimate_json import estimate_to_json

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from tsis.model import Estimate
    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredEstimate, StoredPress


Attribute = str | float | int | bool
Shape = tuple[int, ...]
GZIP_LEVEL = 4  # in every format


class Tree(Protocol):
    """Groups and arrays by path, e.g. ``"frames/target/0/grey"``; attributes are text and numbers."""

    def group(self, path: str, attributes: Mapping[str, Attribute]) -> None:
        """Create a group; ``""`` is the root."""

    def create(self, path: str, shape: Shape, dtype: str, chunks: Shape, attributes: Mapping[str, Attribute]) -> Any:
        """Create an array of at least one axis that is filled by index; each chunk is compressed separately."""


def write_array(tree: Tree, path: str, values: NDArray[Any], attributes: Mapping[str, Attribute]) -> None:
    """Write a small array in one chunk."""
    tree.create(path, values.shape, str(values.dtype), values.shape, attributes)[...] = values


def write_stack(
    tree: Tree, path: str, frames: Iterable[NDArray[Any]], shape: Shape, dtype: str, attributes: Mapping[str, Attribute]
) -> None:
    """Write frames of one size, a chunk each; ``shape`` is (n, rows, columns)."""
    stack = tree.create(path, shape, dtype, (1, *shape[1:]), attributes)
    for at, frame in enumerate(frames):
        stack[at] = frame


FORMAT, VERSION = "tsis-arrays", 1
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def write_layout(record: TargetRecord, tree: Tree) -> None:
    """Write a target record frame by frame; `RecordsError` when a frame does not match its press."""
    tree.group("", {"format": FORMAT, "version": VERSION, "notice": RESEARCH_USE_ONLY, "tsis": __version__})
    document = to_json_value(record.target)
    shown = ("number", "kind", "name", "note", "made", "id", "version")
    tree.group("target", {name: document[name] for name in shown})
    for name, value in record.target.truth.items():
        write_array(tree, f"target/truth/{_link(name)}", np.array([value]), {"units": unit_of(name), "quantity": name})
    _document(tree, "presses", [to_json_value(press) for press in record.presses])
    for position, numbered in _stacks(record).items():
        _write_stack(record, tree, position, numbered)
    for number, stored in enumerate(record.estimates):
        _write_estimate(tree, f"estimates/{number}", stored, in_force=stored in record.active_estimates)
    for name, calibration in record.calibrations.items():
        _bytes(tree, f"calibrations/{_link(name)}", calibration_bytes(calibration))


def _stacks(record: TargetRecord) -> dict[str, list[tuple[int, StoredPress]]]:
    """Numbered presses by the path of their frames: a stack for each role, size and number of bits."""
    stacks: dict[str, dict[tuple[int, int, bool], list[tuple[int, StoredPress]]]] = {}
    for number, press in enumerate(record.presses):
        kind = (press.rows, press.columns, press.full_scale > 255)
        stacks.setdefault(press.role, {}).setdefault(kind, []).append((number, press))
    return {f"frames/{role}/{at}": kind for role, kinds in stacks.items() for at, kind in enumerate(kinds.values())}


def _write_stack(record: TargetRecord, tree: Tree, location: str, numbered: list[tuple[int, StoredPress]]) -> None:
    presses = [press for _, press in numbered]
    first = presses[0]
    dtype = "uint16" if first.full_scale > 255 else "uint8"
    tree.group(location, {"role": first.role})
    write_stack(
        tree,
        f"{location}/grey",
        (_levels(record, press, dtype) for press in presses),
        (len(presses), first.rows, first.columns),
        dtype,
        {"units": "grey level", "axes": "press, row, column"},
    )
    pixels = [press.mm_per_pixel or (math.nan, math.nan) for press in presses]
    columns: dict[str, tuple[Any, str, str]] = {
        "force": ([press.force_n if press.force_n is not None else math.nan for press in presses], "N", "press"),
        "pixel_size": (pixels, "mm", "press, (x, y)"),
        "axis": ([press.axis_px for press in presses], "px", "press, (x, y)"),
        "full_scale": ([press.full_scale for press in presses], "grey level", "press"),
    }
    for name, (values, units, axes) in columns.items():
        write_array(tree, f"{location}/{name}", np.array(values, dtype=float), {"units": units, "axes": axes})
    since = [(press.taken - EPOCH) // timedelta(microseconds=1) for press in presses]
    units = "microseconds since 1970-01-01T00:00:00Z"
    write_array(tree, f"{location}/taken", np.array(since, dtype=np.int64), {"units": units, "axes": "press"})
    order = np.array([number for number, _ in numbered], dtype=np.int64)
    write_array(tree, f"{location}/press", order, {"units": "1", "axes": "press", "index_of": "presses"})


def _levels(record: TargetRecord, press: StoredPress, dtype: str) -> NDArray[Any]:
    result = record.levels(press)
    if int(result.max()) > np.iinfo(dtype).max:  # a file of 8 bits would wrap it round
        raise RecordsError(
            f"frame {press.frame:.12} must hold levels up to its full scale, {press.full_scale:g}; got {result.max()}"
        )
    return result.astype(dtype, copy=False)


def _write_estimate(tree: Tree, location: str, stored: StoredEstimate, *, in_force: bool) -> None:
    result = stored.estimate
    head: dict[str, Attribute] = {
        "kind": stored.kind,
        "made": stored.made.isoformat(),
        "trusted": result.trusted,
        "in_force": in_force,
        "flags": json.dumps(list(result.flags)),
    }
    if result.printed_presence is not None:
        head["presence"] = float(result.printed_presence)
    tree.group(location, head)
    summary = _summary(result) if result.trusted else {}
    group = "samples" if result.trusted else "untrusted"
    for name, values in result.untrusted.samples.items():
        attributes: dict[str, Attribute] = {
            "quantity": name,
            "units": unit_of(name),
            "axes": "sample",
            "prior_sd": float(result.prior_sd[name]),
            "identified": result.identified(name),
            **summary.get(name, {}),
        }
        write_array(tree, f"{location}/{group}/{_link(name)}", values, attributes)
    place = location if result.trusted else f"{location}/{group}"
    _document(tree, f"{place}/document", estimate_to_json(stored))


def _summary(estimate: Estimate) -> dict[str, dict[str, Attribute]]:
    """Summary statistics by parameter."""
    mean, sd, interval = estimate.mean, estimate.sd, estimate.interval(INTERVAL_LEVEL)
    summary: dict[str, dict[str, Attribute]] = {
        name: {
            **({"mean": mean[name], "sd": sd[name]} if estimate.identified(name) else {}),
            "interval_level": INTERVAL_LEVEL,
            "interval_low": interval[name][0],
            "interval_high": interval[name][1],
        }
        for name in estimate.names
    }
    for name, bound in estimate.cramer_rao_sd.items():
        summary[name]["cramer_rao_sd"] = "infinity" if bound == math.inf else float(bound)
    return summary


def _link(name: str) -> str:
    """A name that is valid in any format; the attribute ``quantity`` has the original."""
    link = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:100]
    return link if link == name else f"{link}-{name.encode('utf-8', 'surrogatepass').hex()[:64]}"


def _document(tree: Tree, path: str, content: Any) -> None:
    _bytes(tree, path, json.dumps(content, allow_nan=False).encode())


def _bytes(tree: Tree, path: str, content: bytes) -> None:
    write_array(tree, path, np.frombuffer(content, np.uint8), {"units": "1", "media_type": "application/json"})
