"""A target record as a tree of xarray, as netCDF and Zarr.

::

    /                       attributes of the target; a variable for each true value of a phantom
    /frames/ROLE/K          grey levels over press, y and x with force, time, flags and settings of each press; frames
                            that differ in size, bits, scale, axis or full scale are stacks of their own
    /estimates/K/posterior  samples of each parameter; "untrusted" in place of "posterior" where not trusted
"""

from __future__ import annotations

import json
import math
import re
from datetime import UTC
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import FileInputError, RecordsError, import_extra
from tsis.model.estimate import INTERVAL_LEVEL, unit_of
from tsis.records.export import export_file, export_folder

if TYPE_CHECKING:
    import os

    from tsis.model.estimate import Estimate
    from tsis.records.values import StoredEstimate, StoredPress, TargetRecord


GZIP_LEVEL = 4  # of the grey levels in both formats


def target_tree(record: TargetRecord) -> Any:
    """The target as an `xarray.DataTree`: coordinates, and units (UCUM) as attributes.

    Raises
    ------
    MissingExtraError
        When xarray is not installed.
    RecordsError
        When a frame does not match its press.
    """
    xarray = _library("xarray")
    target = record.target
    head = {
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "number": target.number,
        "kind": target.kind,
        "name": target.name,
        "note": target.note,
        "made": target.made.isoformat(),
        "id": target.id,
        "version": target.version,
    }
    truth = {_link(name): ((), value, _of_quantity(name)) for name, value in target.truth.items()}
    groups = {"/": xarray.Dataset(truth, attrs=head)}
    for path, numbers in _stacks(record).items():
        groups[f"/frames/{path}"] = _frames(record, numbers)
    for number, stored in enumerate(record.estimates):
        groups[f"/estimates/{number}"] = _estimate(record, stored)
        name = "posterior" if stored.estimate.trusted else "untrusted"
        groups[f"/estimates/{number}/{name}"] = _posterior(stored.estimate)
    return xarray.DataTree.from_dict(groups)


def write_netcdf(record: TargetRecord, path: str | os.PathLike[str]) -> None:
    """Write `target_tree` as a new netCDF-4 file, which is HDF5, atomically.

    Raises
    ------
    MissingExtraError
        When xarray or h5netcdf is not installed.
    FileInputError
        When the file exists, or cannot be written.
    RecordsError
        When a frame does not match its press.
    """
    _library("h5netcdf")
    with export_file(path) as draft:
        tree = target_tree(record)
        filters = {"zlib": True, "complevel": GZIP_LEVEL, "shuffle": True, "fletcher32": True}
        encoding = _encoding_of_grey(tree, "chunksizes", filters)
        try:
            # In memory first: HDF5 cannot close a file on a full disk, and ends the program.
            content = tree.to_netcdf(engine="h5netcdf", encoding=encoding)
        except RuntimeError as error:  # HDF5's error for unsupported content
            raise FileInputError(f"the netCDF file must be one that can be written; got: {error}") from error
        draft.write_bytes(content)


def write_zarr(record: TargetRecord, path: str | os.PathLike[str]) -> None:
    """Write `target_tree` as a new folder of Zarr format 3, atomically.

    Raises
    ------
    MissingExtraError
        When xarray or zarr is not installed.
    FileInputError
        When the folder exists, or cannot be written.
    RecordsError
        When a frame does not match its press.
    """
    codecs, storage = _library("zarr.codecs"), _library("zarr.storage")
    with export_folder(path) as draft:
        tree = target_tree(record)
        # Gzip, unlike Zstandard, is in the specification; a checksum detects damage.
        filters = {"compressors": (codecs.GzipCodec(level=GZIP_LEVEL), codecs.Crc32cCodec())}
        encoding = _encoding_of_grey(tree, "chunks", filters)
        content: dict[str, Any] = {}  # in memory first: zarr goes on writing beside a write that failed
        store = storage.MemoryStore(content)
        # Without empty chunks a lost one would read as black.
        tree.to_zarr(store, zarr_format=3, consolidated=False, encoding=encoding, write_empty_chunks=True)
        for name, buffer in content.items():
            (draft / name).parent.mkdir(parents=True, exist_ok=True)
            (draft / name).write_bytes(buffer.to_bytes())


def _library(name: str) -> Any:
    return import_extra(name, feature="netCDF and Zarr export", extra="analysis")


def _encoding_of_grey(tree: Any, chunks: str, filters: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """A compressed chunk for each frame, by group."""
    return {
        node.path: {"grey": {**filters, chunks: (1, *node["grey"].shape[1:])}}
        for node in tree.subtree
        if "grey" in node.data_vars
    }


def _stacks(record: TargetRecord) -> dict[str, list[int]]:
    """Numbers of the presses of each stack, by its path ``ROLE/K``."""
    stacks: dict[str, dict[tuple[Any, ...], list[int]]] = {}
    for number, press in enumerate(record.presses):
        kind = (press.rows, press.columns, press.full_scale, press.mm_per_pixel, press.axis_px)
        stacks.setdefault(press.role, {}).setdefault(kind, []).append(number)
    return {f"{role}/{at}": numbers for role, kinds in stacks.items() for at, numbers in enumerate(kinds.values())}


def _frames(record: TargetRecord, numbers: list[int]) -> Any:
    """A stack of frames; ``press`` is the place of each in the record."""
    xarray = _library("xarray")
    presses = [record.presses[number] for number in numbers]
    grey = xarray.concat([_grey(record, press) for press in presses], dim="press", combine_attrs="drop")
    grey.attrs = {"units": "grey level", "full_scale": presses[0].full_scale}
    times = [np.datetime64(press.taken.astimezone(UTC).replace(tzinfo=None), "us") for press in presses]
    forces = [math.nan if press.force_n is None else press.force_n for press in presses]
    texts = {
        "frame": [press.name for press in presses],
        "sha256": [press.frame for press in presses],
        "id": [press.id for press in presses],
        "probe": [press.probe for press in presses],
        "calibration": [press.calibration or "" for press in presses],
        "flags": [json.dumps(list(press.flags)) for press in presses],
        "settings": [json.dumps(dict(press.settings), default=str) for press in presses],
        "note": [press.note for press in presses],
    }
    frames = xarray.Dataset(
        {"grey": grey},
        coords={
            "press": ("press", np.array(numbers, dtype=np.int64)),
            "force_n": ("press", forces, {"units": "N"}),
            "taken": ("press", times),
            **{name: ("press", np.array(values, dtype=object)) for name, values in texts.items()},
        },
        attrs={"role": presses[0].role},
    )
    frames["taken"].encoding = {"units": "microseconds since 1970-01-01", "dtype": "int64"}
    return frames


def _grey(record: TargetRecord, press: StoredPress) -> Any:
    dtype = np.uint16 if press.full_scale > 255 else np.uint8
    array = record.image(press).to_xarray()
    if array.max() > np.iinfo(dtype).max:  # 8 bits would wrap it round
        raise RecordsError(
            f"frame {press.frame:.12} must hold levels up to its full scale, {press.full_scale:g}; "
            f"got {int(array.max())}"
        )
    return array.astype(dtype)


def _estimate(record: TargetRecord, stored: StoredEstimate) -> Any:
    """What belongs to an estimate as a whole, and the places of its presses in the record."""
    estimate = stored.estimate
    used = [number for number, press in enumerate(record.presses) if press.id in stored.presses]
    head = {
        "kind": stored.kind,
        "made": stored.made.isoformat(),
        "trusted": int(estimate.trusted),
        "in_force": int(stored in record.active_estimates),
        "flags": json.dumps(list(estimate.flags)),
        "prior": estimate.prior,
        "identifiability": estimate.printed_identifiability,
        "probe": stored.probe,
        "calibration": stored.calibration,
        "environment": json.dumps(dict(stored.environment), default=str),
    }
    if estimate.printed_presence is not None:
        head["presence"] = estimate.printed_presence
    return _library("xarray").Dataset({"presses": ("used", np.array(used, dtype=np.int64))}, attrs=head)


def _posterior(estimate: Estimate) -> Any:
    """Samples by parameter, with the summary where it is not withheld."""
    samples = estimate.untrusted.samples
    most = max(map(len, samples.values()), default=0)
    summary = _summary(estimate) if estimate.trusted else {}
    variables = {}
    for name, values in samples.items():
        attributes = {
            **_of_quantity(name),
            "prior_sd": estimate.prior_sd[name],
            "identified": int(estimate.identified(name)),
            **summary.get(name, {}),
        }
        axis = "sample" if len(values) == most else f"sample_{_link(name)}"
        variables[_link(name)] = (axis, np.array(values), attributes)
    return _library("xarray").Dataset(variables)


def _summary(estimate: Estimate) -> dict[str, dict[str, float | str]]:
    """Summary statistics by parameter."""
    mean, sd, interval = estimate.mean, estimate.sd, estimate.interval(INTERVAL_LEVEL)
    summary: dict[str, dict[str, float | str]] = {
        name: {
            **({"mean": mean[name], "sd": sd[name]} if estimate.identified(name) else {}),
            "interval_level": INTERVAL_LEVEL,
            "interval_low": interval[name][0],
            "interval_high": interval[name][1],
        }
        for name in estimate.names
    }
    for name, bound in estimate.cramer_rao_sd.items():
        summary[name]["cramer_rao_sd"] = "infinity" if bound == math.inf else bound  # JSON has no infinity
    return summary


def _of_quantity(name: str) -> dict[str, str]:
    return {"units": unit_of(name), "quantity": name}


def _link(name: str) -> str:
    """A name that is valid in any format; the attribute ``quantity`` has the original."""
    link = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:100]
    return link if link == name else f"{link}-{name.encode('utf-8', 'surrogatepass').hex()[:64]}"
