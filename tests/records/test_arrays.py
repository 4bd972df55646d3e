"""Trees of xarray, netCDF and Zarr hold what the record holds."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import h5py
import numpy as np
import pytest
import xarray
from tests.records.sample import sample_estimate, sample_record

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import FileInputError, RecordsError
from tsis.model.estimate import PosteriorSamples
from tsis.model.image import image_from_xarray
from tsis.records.arrays import target_tree, write_netcdf, write_zarr
from tsis.records.values import TargetRecord


def open_netcdf(path: Path) -> Any:
    with xarray.open_datatree(path, engine="h5netcdf", decode_timedelta=False) as tree:
        return tree.load()


def open_zarr(path: Path) -> Any:
    with xarray.open_datatree(path, engine="zarr", consolidated=False, decode_timedelta=False) as tree:
        return tree.load()


FORMATS = pytest.mark.parametrize(
    ("write", "read"), [(write_netcdf, open_netcdf), (write_zarr, open_zarr)], ids=["netcdf", "zarr"]
)
Write: TypeAlias = Callable[[TargetRecord, Path], None]
Read: TypeAlias = Callable[[Path], Any]


@FORMATS
@pytest.mark.parametrize("full_scale", [255.0, 4095.0])
def test_everything_is_read_back_with_its_unit(tmp_path: Path, write: Write, read: Read, full_scale: float) -> None:
    record = sample_record(full_scale=full_scale)
    write(record, tmp_path / "out")
    tree = read(tmp_path / "out")
    assert (tree.attrs["notice"], tree.attrs["number"]) == (RESEARCH_USE_ONLY, 3)
    assert (tree["depth_mm"], tree["depth_mm"].attrs["units"]) == (5.0, "mm")
    for role in ("target", "plain"):
        stack = tree[f"frames/{role}/0"]
        presses = [record.presses[at] for at in stack["press"].values]
        assert [press.role for press in presses] == [role, role]
        assert stack["grey"].dtype == (np.uint8 if full_scale == 255 else np.uint16)
        assert stack["grey"].attrs == {"units": "grey level", "full_scale": full_scale}
        np.testing.assert_array_equal(stack["grey"], [record.levels(press) for press in presses])
        np.testing.assert_array_equal(stack["force_n"], [press.force_n for press in presses])
        assert [stack[name].attrs["units"] for name in ("force_n", "x", "y")] == ["N", "mm", "mm"]
        taken = [np.datetime64(press.taken.replace(tzinfo=None), "us") for press in presses]
        np.testing.assert_array_equal(stack["taken"], taken)
        for at, press in enumerate(presses):
            one = stack.to_dataset().isel(press=at)
            image = image_from_xarray(one["grey"])
            assert (image.mm_per_pixel, image.axis_px) == (press.mm_per_pixel, press.axis_px)
            texts = [str(one[name].item()) for name in ("frame", "sha256", "id", "probe", "calibration", "note")]
            assert texts == [press.name, press.frame, press.id, press.probe, press.calibration, press.note]
            assert json.loads(one["flags"].item()) == list(press.flags)
            assert json.loads(one["settings"].item()) == dict(press.settings)
    assert record.estimate is not None
    assert tree["estimates/0"].attrs["calibration"] == record.estimate.calibration
    used = [record.presses[at].id for at in tree["estimates/0/presses"].values]
    assert used == list(record.estimate.presses)
    for name, values in record.estimate.estimate.samples.items():
        samples = tree[f"estimates/0/posterior/{name}"]
        np.testing.assert_array_equal(samples, values)
        assert samples.attrs["units"] == ("kPa" if name == "young_kpa" else "mm")
        assert samples.attrs.get("mean") == (None if name == "young_kpa" else np.mean(values))
        assert samples.attrs["identified"] == (name != "young_kpa")


@FORMATS
def test_a_file_holds_the_tree(tmp_path: Path, write: Write, read: Read) -> None:
    record = sample_record()
    write(record, tmp_path / "out")
    xarray.testing.assert_identical(read(tmp_path / "out"), target_tree(record))


@FORMATS
def test_frames_of_other_sizes_are_stacks_of_their_own(tmp_path: Path, write: Write, read: Read) -> None:
    record = sample_record()
    small = np.full((5, 7), 9, np.uint8)
    odd = replace(record.presses[1], frame="f" * 64, rows=5, columns=7, force_n=None, mm_per_pixel=None)
    mixed = TargetRecord(
        target=record.target,
        presses=(record.presses[0], odd),
        read=lambda name: small if name == "f" * 64 else record.read(name),
    )
    write(mixed, tmp_path / "out")
    tree = read(tmp_path / "out")
    assert [tree[f"frames/target/{at}/grey"].shape for at in (0, 1)] == [(1, 96, 150), (1, 5, 7)]
    assert np.isnan(tree["frames/target/1/force_n"]).all()
    assert tree["frames/target/1/x"].attrs["units"] == "px"


@FORMATS
def test_presses_that_are_equal_keep_their_own_places(tmp_path: Path, write: Write, read: Read) -> None:
    record = sample_record(estimated=False)
    first, _, plain, _ = record.presses
    write(replace(record, presses=(first, plain, first, plain, first)), tmp_path / "out")
    tree = read(tmp_path / "out")
    assert list(tree["frames/target/0/press"].values) == [0, 2, 4]
    assert list(tree["frames/plain/0/press"].values) == [1, 3]


@FORMATS
def test_an_estimate_that_is_not_trusted_has_samples_and_no_result(tmp_path: Path, write: Write, read: Read) -> None:
    record = sample_record()
    stored = record.estimates[0]
    doubted = replace(stored, estimate=sample_estimate(trusted=False))
    write(replace(record, estimates=(stored, doubted)), tmp_path / "out")
    good, bad = (read(tmp_path / "out")[f"estimates/{number}"] for number in (0, 1))
    assert (good.attrs["trusted"], bad.attrs["trusted"]) == (1, 0)
    assert (good.attrs["in_force"], bad.attrs["in_force"]) == (0, 1)
    assert set(good.attrs) - set(bad.attrs) == {"presence"}
    interval = {"interval_level", "interval_low", "interval_high", "cramer_rao_sd"}
    for name, values in stored.estimate.samples.items():
        numbers = interval if name == "young_kpa" else {"mean", "sd"} | interval
        assert set(good[f"posterior/{name}"].attrs) - set(bad[f"untrusted/{name}"].attrs) == numbers
        np.testing.assert_array_equal(bad[f"untrusted/{name}"], values)
    assert "posterior" not in bad.children


@FORMATS
def test_the_last_estimate_of_each_kind_is_in_force(tmp_path: Path, write: Write, read: Read) -> None:
    record = sample_record()
    kinds = ("inclusion", "hardness", "inclusion")
    write(replace(record, estimates=tuple(replace(record.estimates[0], kind=kind) for kind in kinds)), tmp_path / "out")
    tree = read(tmp_path / "out")
    assert [tree[f"estimates/{number}"].attrs["in_force"] for number in range(3)] == [0, 1, 1]


@FORMATS
def test_a_bad_frame_leaves_nothing(tmp_path: Path, write: Write, read: Read) -> None:
    record, asked = sample_record(), []

    def counting(name: str) -> Any:
        asked.append(name)
        if len(asked) == 4:
            return record.read(name)[:-1]
        return record.read(name)

    with pytest.raises(RecordsError, match="96 x 150"):
        write(replace(record, read=counting), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []
    assert asked == [press.frame for press in record.presses]


@FORMATS
def test_levels_beyond_the_full_scale_are_refused_and_not_wrapped(tmp_path: Path, write: Write, read: Read) -> None:
    record = sample_record()
    bright = replace(record, read=lambda _: np.full((96, 150), 300, np.uint16))
    with pytest.raises(RecordsError, match="got 300"):
        write(bright, tmp_path / "out")


@FORMATS
@pytest.mark.parametrize("what", ["file", "folder", "link"])
def test_nothing_is_written_over(tmp_path: Path, write: Write, read: Read, what: str) -> None:
    place = tmp_path / "out"
    if what == "file":
        place.write_bytes(b"mine")
    elif what == "folder":
        place.mkdir()
    else:
        place.symlink_to(tmp_path / "nowhere")
    with pytest.raises(FileInputError, match="must be a new name"):
        write(sample_record(), place)
    assert list(tmp_path.iterdir()) == [place]
    assert what != "file" or place.read_bytes() == b"mine"


@FORMATS
def test_odd_names_of_parameters_are_kept_beside_links_that_any_format_takes(
    tmp_path: Path, write: Write, read: Read
) -> None:
    record = sample_record()
    stored = record.estimates[0]
    odd = replace(
        stored.estimate,
        untrusted=PosteriorSamples(
            samples={"../a/b": np.ones(3), "a_b": np.ones(2)}, prior_sd={"../a/b": 1.0, "a_b": 1.0}
        ),
        cramer_rao_sd={},
    )
    write(replace(record, estimates=(replace(stored, estimate=odd),)), tmp_path / "out")
    samples = read(tmp_path / "out")["estimates/0/posterior"].data_vars
    assert {values.attrs["quantity"]: values.shape for values in samples.values()} == {"../a/b": (3,), "a_b": (2,)}


def test_frames_of_netcdf_are_chunked_compressed_and_summed(tmp_path: Path) -> None:
    write_netcdf(sample_record(), tmp_path / "out.nc")
    with h5py.File(tmp_path / "out.nc", "r") as file:
        grey = file["frames/target/0/grey"]
        assert (grey.chunks, grey.compression, grey.shuffle, grey.fletcher32) == ((1, 96, 150), "gzip", True, True)
        offset = grey.id.get_chunk_info(0).byte_offset
    content = bytearray((tmp_path / "out.nc").read_bytes())
    content[offset + 100] ^= 1
    (tmp_path / "out.nc").write_bytes(content)
    with h5py.File(tmp_path / "out.nc", "r") as file, pytest.raises(OSError, match="filter"):
        file["frames/target/0/grey"][0]


def test_zarr_is_format_3_and_its_chunks_can_be_read_without_zarr(tmp_path: Path) -> None:
    record = sample_record()
    black = replace(record, read=lambda name: record.read(name) * (name != record.presses[0].frame))
    write_zarr(black, tmp_path / "out")
    head = json.loads((tmp_path / "out/frames/target/0/grey/zarr.json").read_bytes())
    assert (head["zarr_format"], head["data_type"], head["shape"]) == (3, "uint8", [2, 96, 150])
    assert [codec["name"] for codec in head["codecs"]] == ["bytes", "gzip", "crc32c"]
    assert (tmp_path / "out/frames/target/0/grey/c/0/0/0").exists()
    chunk = (tmp_path / "out/frames/target/0/grey/c/1/0/0").read_bytes()
    assert gzip.decompress(chunk[:-4]) == record.levels(record.presses[1]).tobytes()
    broken = bytes([*chunk[:-5], chunk[-5] ^ 1, *chunk[-4:]])
    (tmp_path / "out/frames/target/0/grey/c/1/0/0").write_bytes(broken)
    with pytest.raises(ValueError, match="checksum"):
        open_zarr(tmp_path / "out")
