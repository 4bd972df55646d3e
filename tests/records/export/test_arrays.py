import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import h5py
import numpy as np
import pytest
import zarr
from tests.records.sample import sample_estimate, sample_record

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.calibration.file import calibration_sha256, read_calibration
from tsis.errors import FileInputError, RecordsError
from tsis.files import from_json_value, to_json_value
from tsis.model import PosteriorSamples
from tsis.records import TargetRecord
from tsis.records._estimate_json import estimate_from_json
from tsis.records._values import StoredPress
from tsis.records.export.arrays import write_hdf5, write_zarr


def open_hdf5(path: Path) -> Any:
    return h5py.File(path, "r")


def open_zarr(path: Path) -> Any:
    return zarr.open_group(str(path), mode="r")


FORMATS = pytest.mark.parametrize(
    ("write", "read"), [(write_hdf5, open_hdf5), (write_zarr, open_zarr)], ids=["hdf5", "zarr"]
)
Write: TypeAlias = Callable[[TargetRecord, Path], None]
Read: TypeAlias = Callable[[Path], Any]


def children(group: Any) -> Any:
    return group.items() if isinstance(group, h5py.Group) else group.members()


def document(array: Any) -> Any:
    assert array.attrs["media_type"] == "application/json"
    return json.loads(np.asarray(array[...]).tobytes())


@FORMATS
@pytest.mark.parametrize("full_scale", [255.0, 4095.0])
def test_everything_is_read_back_with_its_unit(tmp_path: Path, write: Write, read: Read, full_scale: float) -> None:
    record = sample_record(full_scale=full_scale)
    write(record, tmp_path / "out")
    file = read(tmp_path / "out")
    assert (file.attrs["format"], file.attrs["version"], file.attrs["notice"]) == ("tsis-arrays", 1, RESEARCH_USE_ONLY)
    assert file["target"].attrs["number"] == 3
    assert file["target/truth/depth_mm"][0] == 5.0
    for role in ("target", "plain"):
        stack = file[f"frames/{role}/0"]
        presses = [record.presses[at] for at in stack["press"][...]]
        assert [press.role for press in presses] == [role, role]
        assert stack["grey"].dtype == (np.uint8 if full_scale == 255 else np.uint16)
        np.testing.assert_array_equal(stack["grey"][...], [record.levels(press) for press in presses])
        np.testing.assert_array_equal(stack["force"][...], [press.force_n for press in presses])
        np.testing.assert_array_equal(stack["pixel_size"][...], [press.mm_per_pixel for press in presses])
        seconds = np.asarray(stack["taken"][...]) / 1e6
        np.testing.assert_array_equal(seconds, [press.taken.timestamp() for press in presses])
        assert [stack[name].attrs["units"] for name in ("force", "pixel_size", "axis")] == ["N", "mm", "px"]
    stored = [from_json_value(StoredPress, item, "press", complete=True) for item in document(file["presses"])]
    assert stored == list(record.presses)
    assert record.estimate is not None
    samples = {name: np.asarray(values[...]) for name, values in children(file["estimates/0/samples"])}
    for name, values in record.estimate.estimate.samples.items():
        np.testing.assert_array_equal(samples[name], values)
        said = file[f"estimates/0/samples/{name}"].attrs
        assert said["units"] == ("kPa" if name == "young_kpa" else "mm")
        assert said.get("mean") == (None if name == "young_kpa" else np.mean(values))
        assert said["identified"] == (name != "young_kpa")
    back = estimate_from_json(document(file["estimates/0/document"]), samples)
    assert back.estimate.mean == record.estimate.estimate.mean
    assert back.estimate.provenance == record.estimate.estimate.provenance
    ((name, content),) = children(file["calibrations"])
    (tmp_path / "calibration.json").write_bytes(np.asarray(content[...]).tobytes())
    assert calibration_sha256(read_calibration(tmp_path / "calibration.json")) == name == record.presses[0].calibration


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
    file = read(tmp_path / "out")
    assert [file[f"frames/target/{at}/grey"].shape for at in (0, 1)] == [(1, 96, 150), (1, 5, 7)]
    assert np.isnan(file["frames/target/1/force"][...]).all()
    assert np.isnan(file["frames/target/1/pixel_size"][...]).all()
    assert document(file["presses"]) == [to_json_value(press) for press in mixed.presses]


@FORMATS
def test_presses_that_are_equal_keep_their_own_places(tmp_path: Path, write: Write, read: Read) -> None:
    record = sample_record(estimated=False)
    first, _, plain, _ = record.presses
    write(replace(record, presses=(first, plain, first, plain, first)), tmp_path / "out")
    file = read(tmp_path / "out")
    assert list(file["frames/target/0/press"][...]) == [0, 2, 4]
    assert list(file["frames/plain/0/press"][...]) == [1, 3]


@FORMATS
def test_an_estimate_that_is_not_trusted_has_samples_and_no_result(tmp_path: Path, write: Write, read: Read) -> None:
    record = sample_record()
    stored = record.estimates[0]
    doubted = replace(stored, estimate=sample_estimate(trusted=False))
    write(replace(record, estimates=(stored, doubted)), tmp_path / "out")
    good, bad = (read(tmp_path / "out")[f"estimates/{number}"] for number in (0, 1))
    assert (good.attrs["trusted"], bad.attrs["trusted"]) == (True, False)
    assert (good.attrs["in_force"], bad.attrs["in_force"]) == (False, True)
    assert set(good.attrs) - set(bad.attrs) == {"presence"}
    interval = {"interval_level", "interval_low", "interval_high", "cramer_rao_sd"}
    for name, values in stored.estimate.samples.items():
        numbers = interval if name == "young_kpa" else {"mean", "sd"} | interval
        assert set(good[f"samples/{name}"].attrs) - set(bad[f"untrusted/{name}"].attrs) == numbers
        np.testing.assert_array_equal(bad[f"untrusted/{name}"][...], values)
    assert "samples" not in dict(children(bad))


@FORMATS
def test_the_last_estimate_of_each_kind_is_in_force(tmp_path: Path, write: Write, read: Read) -> None:
    record = sample_record()
    kinds = ("inclusion", "hardness", "inclusion")
    write(replace(record, estimates=tuple(replace(record.estimates[0], kind=kind) for kind in kinds)), tmp_path / "out")
    file = read(tmp_path / "out")
    assert [file[f"estimates/{number}"].attrs["in_force"] for number in range(3)] == [False, True, True]


@FORMATS
def test_one_frame_at_a_time_is_asked_for_and_a_bad_one_leaves_nothing(
    tmp_path: Path, write: Write, read: Read
) -> None:
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
    samples = read(tmp_path / "out")["estimates/0/samples"]
    assert {values.attrs["quantity"]: values.shape for _, values in children(samples)} == {"../a/b": (3,), "a_b": (2,)}


def test_hdf5_frames_are_chunked_compressed_and_summed(tmp_path: Path) -> None:
    write_hdf5(sample_record(), tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5", "r") as file:
        grey = file["frames/target/0/grey"]
        assert (grey.chunks, grey.compression, grey.shuffle, grey.fletcher32) == ((1, 96, 150), "gzip", True, True)
        offset = grey.id.get_chunk_info(0).byte_offset
    content = bytearray((tmp_path / "out.h5").read_bytes())
    content[offset + 100] ^= 1
    (tmp_path / "out.h5").write_bytes(content)
    with h5py.File(tmp_path / "out.h5", "r") as file, pytest.raises(OSError, match="filter"):
        file["frames/target/0/grey"][0]


def test_zarr_is_format_3_and_its_chunks_can_be_read_without_zarr(tmp_path: Path) -> None:
    record = sample_record()
    write_zarr(record, tmp_path / "out")
    head = json.loads((tmp_path / "out/frames/target/0/grey/zarr.json").read_bytes())
    assert (head["zarr_format"], head["data_type"], head["shape"]) == (3, "uint8", [2, 96, 150])
    assert [codec["name"] for codec in head["codecs"]] == ["bytes", "gzip", "crc32c"]
    chunk = (tmp_path / "out/frames/target/0/grey/c/1/0/0").read_bytes()
    assert gzip.decompress(chunk[:-4]) == record.levels(record.presses[1]).tobytes()
    broken = bytes([*chunk[:-5], chunk[-5] ^ 1, *chunk[-4:]])
    (tmp_path / "out/frames/target/0/grey/c/1/0/0").write_bytes(broken)
    with pytest.raises(ValueError, match="checksum"):
        zarr.open_group(str(tmp_path / "out"), mode="r")["frames/target/0/grey"][1]  # type: ignore[index]
