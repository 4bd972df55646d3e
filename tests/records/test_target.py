"""Bundles come back as they were; hostile ones are refused by the name of the file, within bounds."""

from __future__ import annotations

import hashlib
import json
import os
import random
import struct
import tracemalloc
import zipfile
import zlib
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from tests.records.sample import sample_record
from tests.records.variants import Memory, files_of, plain, sealed

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.calibration.file import calibration_bytes
from tsis.errors import FileInputError, InputError, RecordsError
from tsis.files.images import LARGEST_PIXELS
from tsis.records.target import largest, read_bundle, read_picture, read_source, write_bundle
from tsis.records.values import TargetRecord

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.mark.parametrize("name", ["out", "out.zip"])
@pytest.mark.parametrize("full_scale", [255.0, 4095.0])
@pytest.mark.parametrize("kind", ["phantom", "subject"])
def test_a_dossier_comes_back_as_it_was(tmp_path: Path, name: str, full_scale: float, kind: str) -> None:
    record = sample_record(full_scale=full_scale, kind=kind)
    write_bundle(record, tmp_path / name)
    back = read_bundle(tmp_path / name)
    assert plain(back) == plain(record)
    for press in record.presses:
        assert back.levels(press).dtype == record.levels(press).dtype
        np.testing.assert_array_equal(back.levels(press), record.levels(press))
    for cited, known in record.calibrations.items():
        assert calibration_bytes(back.calibrations[cited]) == calibration_bytes(known)
    assert list(tmp_path.iterdir()) == [tmp_path / name]


def test_a_target_without_presses_is_a_bundle_too(tmp_path: Path) -> None:
    record = sample_record(estimated=False)
    bare = TargetRecord(target=record.target, presses=(), read=record.read)
    write_bundle(bare, tmp_path / "out")
    assert plain(read_bundle(tmp_path / "out")) == plain(bare)


def test_equal_dossiers_are_equal_bundles_named_by_their_manifest(tmp_path: Path) -> None:
    seals = [write_bundle(sample_record(), tmp_path / name) for name in ("a", "b.zip", "c.zip")]
    assert len(set(seals)) == 1
    assert (tmp_path / "b.zip").read_bytes() == (tmp_path / "c.zip").read_bytes()
    content = (tmp_path / "a" / "manifest.json").read_bytes()
    assert hashlib.sha256(content).hexdigest() == seals[0]
    manifest = json.loads(content)
    assert manifest["notice"] == RESEARCH_USE_ONLY
    for name, entry in manifest["files"].items():
        found = (tmp_path / "a" / name).read_bytes()
        assert entry == {"sha256": hashlib.sha256(found).hexdigest(), "bytes": len(found)}


def test_a_folder_zipped_by_another_program_is_read(tmp_path: Path) -> None:
    write_bundle(sample_record(), tmp_path / "out")
    with zipfile.ZipFile(tmp_path / "own.zip", "w", zipfile.ZIP_DEFLATED) as file:
        for path in sorted((tmp_path / "out").rglob("*")):
            file.write(path, str(path.relative_to(tmp_path / "out")))
    assert plain(read_bundle(tmp_path / "own.zip")) == plain(sample_record())


@pytest.mark.parametrize("name", ["out", "out.zip"])
def test_nothing_is_written_over(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"mine")
    with pytest.raises(FileInputError, match="must be a new name"):
        write_bundle(sample_record(), tmp_path / name)
    assert (tmp_path / name).read_bytes() == b"mine"
    assert list(tmp_path.iterdir()) == [tmp_path / name]


@pytest.mark.parametrize("name", ["out", "out.zip"])
def test_what_could_not_be_read_back_is_not_written(tmp_path: Path, name: str) -> None:
    record = sample_record()
    wrong = [
        replace(record, calibrations={}),
        replace(record, presses=record.presses[1:]),  # on which the estimate rests
        replace(record, presses=(replace(record.presses[0], columns=149), *record.presses[1:])),
    ]
    for each in wrong:
        with pytest.raises((RecordsError, InputError)):
            write_bundle(each, tmp_path / name)
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "name", ["manifest.json", "target.json", "presses.json", "estimates.json", "frames", "calibrations", "samples"]
)
def test_a_changed_missing_or_grown_file_is_named(tmp_path: Path, name: str) -> None:
    write_bundle(sample_record(), tmp_path / "out")
    path = tmp_path / "out" / name
    if path.is_dir():
        path = min(path.iterdir())
    whole = path.read_bytes()
    changed = bytes([*whole[:-5], whole[-5] ^ 1, *whole[-4:]])
    for content in (changed, whole[:-1], whole + b" ", b""):
        path.write_bytes(content)
        with pytest.raises(FileInputError, match=path.name):
            read_bundle(tmp_path / "out")
    path.unlink()
    with pytest.raises(FileInputError, match=path.name):
        read_bundle(tmp_path / "out")


def test_a_frame_changed_after_the_bundle_was_read_is_refused_when_it_is_asked_for(tmp_path: Path) -> None:
    write_bundle(sample_record(), tmp_path / "out")
    back = read_bundle(tmp_path / "out")
    path = tmp_path / "out" / "frames" / f"{back.presses[0].frame}.png"
    content = bytearray(path.read_bytes())
    content[60] ^= 1
    path.write_bytes(content)
    with pytest.raises(FileInputError, match=path.name):
        back.levels(back.presses[0])


@pytest.mark.parametrize(
    "name", ["extra.json", "frames/extra.png", "frames/a/b.png", "samples/00001.samples", ".hidden"]
)
def test_unknown_files_are_refused_by_name(tmp_path: Path, name: str) -> None:
    write_bundle(sample_record(), tmp_path / "out")
    path = tmp_path / "out" / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"x")
    with pytest.raises(FileInputError, match=name.split("/b")[0].replace(".", r"\.")):
        read_bundle(tmp_path / "out")


@pytest.mark.skipif(os.name != "posix", reason="links and pipes of POSIX")
@pytest.mark.parametrize("what", ["link", "pipe", "folder link"])
def test_links_and_devices_are_refused(tmp_path: Path, what: str) -> None:
    write_bundle(sample_record(), tmp_path / "out")
    path = tmp_path / "out" / "target.json"
    if what == "folder link":
        path = tmp_path / "out" / "samples"
    path.rename(tmp_path / "elsewhere")
    if what == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(FileInputError, match=path.name):
        read_bundle(tmp_path / "out")


@pytest.mark.parametrize(
    "name", ["../target.json", "/etc/passwd", "C:\\x", "frames\\a.png", "x/", "targets/target.json"]
)
def test_zip_files_with_other_names_are_refused(tmp_path: Path, name: str) -> None:
    write_bundle(sample_record(), tmp_path / "out.zip")
    with zipfile.ZipFile(tmp_path / "out.zip", "a") as file:
        file.writestr(name, b"x")
    with pytest.raises(FileInputError, match="must not be in a bundle"):
        read_bundle(tmp_path / "out.zip")


def test_a_name_twice_in_a_zip_file_is_refused(tmp_path: Path) -> None:
    write_bundle(sample_record(), tmp_path / "out.zip")
    with zipfile.ZipFile(tmp_path / "out.zip", "a") as file, pytest.warns(UserWarning, match="Duplicate"):
        file.writestr("target.json", b"{}")
    with pytest.raises(FileInputError, match="every name once"):
        read_bundle(tmp_path / "out.zip")


def test_what_is_no_bundle_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.zip").write_bytes(b"PK" * 100)
    (tmp_path / "short.zip").write_bytes(b"PK")
    (tmp_path / "empty").mkdir()
    for name in ("text.zip", "short.zip", "empty", "nowhere"):
        with pytest.raises(FileInputError):
            read_bundle(tmp_path / name)


def test_a_bundle_of_a_later_version_says_so(tmp_path: Path) -> None:
    files = files_of(sample_record())
    manifest = json.loads(files["manifest.json"]) | {"version": 2}
    files["manifest.json"] = json.dumps(manifest).encode()
    write_bundle(sample_record(), tmp_path / "out")
    (tmp_path / "out" / "manifest.json").write_bytes(sealed(files)["manifest.json"])
    with pytest.raises(FileInputError, match="must be of tsis-bundle 1; got 'tsis-bundle' 2"):
        read_bundle(tmp_path / "out")


WHOLE = files_of(sample_record())
FRAMES = sorted(name for name in WHOLE if name.startswith("frames/"))
MIB = 2**20


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png(
    rows: int,
    columns: int,
    data: bytes,
    extra: bytes = b"",
    kind: tuple[int, ...] = (8, 0, 0, 0, 0),
) -> bytes:
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, *kind))
    return b"\x89PNG\r\n\x1a\n" + head + extra + chunk(b"IDAT", zlib.compress(data, 1)) + chunk(b"IEND", b"")


@contextmanager
def at_most(mebibytes: float) -> Iterator[None]:
    """Little memory is taken by Python and NumPy."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < mebibytes * MIB
    finally:
        tracemalloc.stop()


def refused(files: dict[str, bytes], says: str) -> None:
    with at_most(150), pytest.raises(FileInputError, match=says):
        read_source(Memory(files))


def test_the_bundles_in_memory_are_bundles() -> None:
    assert plain(read_source(Memory(WHOLE))) == plain(sample_record())
    assert sealed(WHOLE) == WHOLE
    good = png(96, 150, bytes(96 * 151))
    read_source(Memory(sealed(WHOLE | {FRAMES[0]: good})))  # so that what is refused below is refused for its fault


@pytest.mark.parametrize(
    ("picture", "says"),
    [
        (png(60_000, 60_000, bytes(10 * MIB)), "must be 96 x 150 pixels"),
        (png(96, 150, bytes(96 * 151), chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(50 * MIB), 1))), "'zTXt'"),
        (png(96, 150, bytes(96 * 151), chunk(b"iCCP", b"a\0\0" + zlib.compress(bytes(50 * MIB), 1))), "'iCCP'"),
        (png(96, 150, bytes(96 * 451), kind=(8, 2, 0, 0, 0)), "8 or 16 bits of grey"),
        (png(96, 150, bytes(96 * 151), kind=(8, 0, 0, 0, 1)), "not interlaced"),
        (png(96, 150, bytes(96 * 20), kind=(1, 0, 0, 0, 0)), "8 or 16 bits of grey"),
        (png(96, 150, bytes(5)), "do not unpack to 14496 bytes"),
        (png(96, 150, bytes(96 * 151 + 1)), "do not unpack to 14496 bytes"),
        (png(96, 150, b"\x09" + bytes(96 * 151 - 1)), "readable PNG"),
        (png(96, 150, bytes(96 * 151)) + b"more", "goes on after its end"),
        (png(96, 150, bytes(96 * 151))[:-12], "truncated"),
        (b"\xff\xd8\xff\xe0" + bytes(60), "must be a PNG file"),
    ],
)
def test_frames_that_are_bombs_or_no_frames_are_refused(picture: bytes, says: str) -> None:
    refused(sealed(WHOLE | {FRAMES[0]: picture}), says)


def test_a_picture_with_far_more_data_than_its_header_says_is_refused_without_unpacking_it() -> None:
    endless = png(96, 150, bytes(100 * MIB))
    with at_most(5), pytest.raises(FileInputError, match="do not unpack to 14496 bytes"):
        read_picture(endless, FRAMES[0], 96, 150)


@pytest.mark.parametrize("shape", [(1, 1), (1024, 1023), (1025, 1023), (2048, 1023)])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("packing", [1, 9])
def test_black_frames_of_every_size_are_pictures(shape: tuple[int, int], dtype: type, packing: int) -> None:
    black: Any = np.zeros(shape, dtype)
    content = cv2.imencode(".png", black, (cv2.IMWRITE_PNG_COMPRESSION, packing))[1].tobytes()
    np.testing.assert_array_equal(read_picture(content, "black.png", *shape), black)


def test_a_press_that_agrees_with_a_picture_too_large_is_refused_before_it_is_unpacked() -> None:
    presses = json.loads(WHOLE["presses.json"])
    presses[0] |= {"rows": 60_000, "columns": 60_000}
    name = f"frames/{presses[0]['frame']}.png"
    files = WHOLE | {"presses.json": json.dumps(presses).encode(), name: png(60_000, 60_000, bytes(MIB))}
    refused(sealed(files), f"must hold at most {LARGEST_PIXELS} pixels")


@pytest.mark.slow
def test_any_frame_that_may_be_stored_may_be_in_a_bundle() -> None:
    black = np.zeros((8000, 8000), np.uint16)
    assert black.size <= LARGEST_PIXELS
    content = cv2.imencode(".png", black, (cv2.IMWRITE_PNG_COMPRESSION, 1))[1].tobytes()
    np.testing.assert_array_equal(read_picture(content, "black.png", *black.shape), black)
    # Noise of 16 bits cannot be packed: its file is longer than its levels by a byte a row, and a few a chunk.
    noise = np.random.default_rng(1).integers(0, 65536, (500, 4000)).astype(np.uint16)
    packed = len(cv2.imencode(".png", noise, (cv2.IMWRITE_PNG_COMPRESSION, 1))[1])
    assert LARGEST_PIXELS * packed / noise.size < largest(FRAMES[0])


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"[" * 100_000, "readable JSON|values"),
        (b"[" * 400_000 + b"]" * 400_000, "readable JSON"),
        (b"[" + b"[],{}," * 2_000_000 + b"1]", "at most 500000 values"),
        (b"[" + b"9" * 1_000_000 + b"]", "readable JSON"),
        (b"[NaN]", "NaN"),
        (b"[Infinity]", "Infinity"),
        (b'[{"role":1,"role":2}]', "a name twice"),
        (b"[1e999]", "press 1 must be an object"),
        (b"\xff\xfe[]", "readable JSON"),
        (b"{}", "JSON list"),
        (b"[" + b" " * (16 * MIB) + b"]", "must hold 1 to"),
    ],
)
def test_documents_that_are_bombs_or_no_documents_are_refused(content: bytes, says: str) -> None:
    refused(sealed(WHOLE | {"presses.json": content}), says)


@pytest.mark.parametrize("name", ["target.json", "presses.json", "estimates.json"])
def test_forged_values_are_refused_or_are_values(name: str) -> None:
    """Every value in turn is replaced by every odd one, with hashes that fit: a dossier or a typed refusal."""
    odd: list[Any] = [None, True, -1, 0, 10**400, 1e308, "", "x" * 5000, "\0", "\ud800", [], {}, [[]], {"a": 1}, "../x"]
    refusals = 0
    document = json.loads(WHOLE[name])
    for path in paths(document):
        for value in odd:
            forged = put(document, path, value)
            try:
                read_source(Memory(sealed(WHOLE | {name: json.dumps(forged).encode()})))
            except FileInputError:
                refusals += 1
    assert refusals > 0.5 * len(odd) * len(paths(document)) * (0.5 if name == "estimates.json" else 1)


def paths(value: Any) -> list[tuple[Any, ...]]:
    if isinstance(value, dict):
        return [(), *((key, *rest) for key, each in value.items() for rest in paths(each))]
    if isinstance(value, list):
        return [(), *((at, *rest) for at, each in list(enumerate(value))[:1] for rest in paths(each))]
    return [()]


def put(value: Any, path: tuple[Any, ...], new: Any) -> Any:
    if not path:
        return new
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = put(value[path[0]], path[1:], new)
    return copy


def flipped(rng: random.Random, data: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]


def cut(rng: random.Random, data: bytes) -> bytes:
    return data[: rng.randrange(len(data))]


def grown(rng: random.Random, data: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + rng.randbytes(rng.randrange(1, 9)) + data[at:]


def holed(rng: random.Random, data: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + data[at + rng.randrange(1, 99) :]


CHANGES = (flipped, cut, grown, holed)


def test_two_thousand_changed_files_are_refused_by_name() -> None:
    rng = random.Random(5)
    names = sorted(WHOLE)
    for _ in range(2000):
        name = rng.choice(names)
        changed = rng.choice(CHANGES)(rng, WHOLE[name])
        if changed == WHOLE[name]:
            continue
        with pytest.raises(FileInputError) as refusal:
            read_source(Memory(WHOLE | {name: changed}))
        assert name in str(refusal.value)


def test_a_thousand_changed_files_with_hashes_that_fit_raise_nothing_else() -> None:
    rng = random.Random(6)
    names = sorted(set(WHOLE) - {"manifest.json"})
    accepted = 0
    for _ in range(1000):
        name = rng.choice(names)
        try:
            read_source(Memory(sealed(WHOLE | {name: rng.choice(CHANGES)(rng, WHOLE[name])})))
            accepted += name.startswith(("frames", "samples"))
        except FileInputError:
            pass
    assert accepted == 0  # these hold check sums of their own


def test_hundreds_of_changed_zip_files_are_refused_or_the_same(tmp_path: Path) -> None:
    write_bundle(sample_record(), tmp_path / "out.zip")
    whole, expected = (tmp_path / "out.zip").read_bytes(), plain(sample_record())
    rng, directory = random.Random(7), len(whole) - 3000
    changed = tmp_path / "changed.zip"
    same = 0
    for number in range(400):
        data = bytearray(whole)
        data[rng.randrange(directory if number % 2 else 0, len(whole))] ^= 1 << rng.randrange(8)
        changed.write_bytes(data)
        try:
            found = plain(read_bundle(changed))
        except FileInputError:
            continue
        assert found == expected  # a time or a right that nobody reads was changed
        same += 1
    assert same < 320


def test_zip_bombs_are_refused_before_they_are_unpacked(tmp_path: Path) -> None:
    bomb = tmp_path / "bomb.zip"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as file:
        for name in ("manifest.json", "target.json", "presses.json", "estimates.json"):
            file.writestr(name, bytes(16 * MIB))
    with pytest.raises(FileInputError, match="must unpack to at most 100 times its size"):
        read_bundle(bomb)


def test_a_zip_file_that_lies_about_a_size_is_refused_at_that_size(tmp_path: Path) -> None:
    bomb = tmp_path / "bomb.zip"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in sorted(WHOLE.items(), key=lambda each: each[0] != "manifest.json"):
            file.writestr(name, bytes(100 * MIB) if name == "manifest.json" else content)
    data = bytearray(bomb.read_bytes())
    for at in (data.index(b"PK\x03\x04") + 22, data.index(b"PK\x01\x02") + 24):
        data[at : at + 4] = struct.pack("<I", 2000)
    bomb.write_bytes(data)
    with at_most(20), pytest.raises(FileInputError, match=r"manifest\.json"):
        read_bundle(bomb)


def test_a_zip_file_with_a_long_directory_is_refused_before_it_is_read(tmp_path: Path) -> None:
    crowd = tmp_path / "crowd.zip"
    entry = struct.pack("<4s6H3I5H2I", b"PK\x01\x02", 20, 20, 0, 0, 0, 33, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0) + b"a"
    directory = entry * 200_000
    end = struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, 65535, 65535, len(directory), 0, 0)
    crowd.write_bytes(directory + end)
    with at_most(5), pytest.raises(FileInputError, match="its directory is longer"):
        read_bundle(crowd)
