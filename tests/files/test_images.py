"""Pictures that ask for much: refused before memory is taken; notes never reach a decoder; honest ones load."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image, TiffImagePlugin
from PIL.PngImagePlugin import PngInfo

from tsis.errors import FileInputError
from tsis.files.images import (
    FREE_PIXELS,
    LARGEST_PIXELS,
    PIXELS_A_BYTE,
    image_fault,
    jpeg_fault,
    rows_missing,
    size_fault,
    tiff_fault,
    without_metadata,
)
from tsis.instrument.image_files import read_image, read_levels

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


@pytest.fixture
def colour() -> NDArray[np.uint8]:
    return np.random.default_rng(4).integers(0, 256, (23, 19, 3)).astype(np.uint8)


def _saved(levels: NDArray[Any], kind: str, **options: Any) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(levels).save(stream, kind, **options)
    return stream.getvalue()


def _noted_png(colour: NDArray[np.uint8]) -> bytes:
    notes = PngInfo()
    notes.add_text("Comment", "secret" * 1000, zip=True)
    notes.add_itxt("Title", "secret" * 1000, zip=True)
    return _saved(colour, "PNG", pnginfo=notes, icc_profile=b"secret" * 100, dpi=(300, 300))


def _noted_jpeg(colour: NDArray[np.uint8], **options: Any) -> bytes:
    exif = Image.Exif()
    exif[0x010E] = "secret" * 100
    return _saved(colour, "JPEG", exif=exif, comment=b"secret", icc_profile=b"secret" * 100, **options)


def test_notes_are_taken_out_and_pixels_are_not(tmp_path: Path, colour: NDArray[np.uint8]) -> None:
    whole = _noted_png(colour)
    alone = without_metadata(whole)
    assert all(kind in whole for kind in (b"iCCP", b"zTXt", b"iTXt", b"pHYs"))
    assert not any(kind in alone for kind in (b"iCCP", b"zTXt", b"iTXt", b"pHYs"))
    assert image_fault(alone) is None
    decoded = cv2.imdecode(np.frombuffer(alone, np.uint8), cv2.IMREAD_UNCHANGED)
    assert decoded is not None
    np.testing.assert_array_equal(decoded[..., ::-1], colour)
    (tmp_path / "a.png").write_bytes(whole)
    np.testing.assert_array_equal(read_levels(tmp_path / "a.png"), colour)


@pytest.mark.parametrize("progressive", [False, True])
def test_a_jpeg_with_notes_loads(tmp_path: Path, colour: NDArray[np.uint8], progressive: bool) -> None:
    whole = _noted_jpeg(colour, progressive=progressive)
    assert b"secret" in whole
    (tmp_path / "a.jpg").write_bytes(whole)
    np.testing.assert_array_equal(read_levels(tmp_path / "a.jpg"), np.asarray(Image.open(io.BytesIO(whole))))


def test_what_has_no_notes_is_handed_on_as_it_is(colour: NDArray[np.uint8]) -> None:
    for kind in ("PNG", "JPEG", "BMP", "TIFF"):
        whole = _saved(colour, kind)
        assert len(without_metadata(whole)) == len(whole)
    plain = _saved(colour, "PNG")
    assert without_metadata(plain) is plain


def test_the_colours_of_an_adobe_jpeg_stay(tmp_path: Path, colour: NDArray[np.uint8]) -> None:
    whole = _saved(colour, "JPEG", quality=95, subsampling=0, keep_rgb=True)  # stored as RGB, which a segment tells
    (tmp_path / "a.jpg").write_bytes(whole)
    np.testing.assert_array_equal(read_levels(tmp_path / "a.jpg"), np.asarray(Image.open(io.BytesIO(whole))))


def test_more_scans_than_any_encoder_makes_are_refused(colour: NDArray[np.uint8]) -> None:
    whole = _saved(colour, "JPEG", progressive=True)
    assert jpeg_fault(whole) is None
    scan = whole.rindex(b"\xff\xda")
    assert "scans" in str(jpeg_fault(whole[:scan] + whole[scan:-2] * 200 + b"\xff\xd9"))
    assert "segments" in str(jpeg_fault(whole[:2] + b"\xff\xfe\x00\x02" * 5000 + whole[2:]))
    header = whole.index(b"\xff\xc2")
    large = whole[: header + 5] + struct.pack(">HH", 60_000, 60_000) + whole[header + 9 :]
    assert "pixels" in str(jpeg_fault(large))


def test_png_files_of_endless_chunks_are_refused(colour: NDArray[np.uint8]) -> None:
    whole = _saved(colour, "PNG")
    empty = struct.pack(">I", 0) + b"tEXt" + struct.pack(">I", zlib.crc32(b"tEXt"))
    assert image_fault(whole[:33] + empty * 1000 + whole[33:]) is None
    assert "chunks" in str(image_fault(whole[:33] + empty * 100_001 + whole[33:]))


def _tiff(entries: list[tuple[int, int, int, int]], following: int = 0) -> bytes:
    body = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0\x08\0\0\0" + struct.pack("<H", len(entries)) + body + struct.pack("<I", following)


SIZE = [(256, 4, 1, 9), (257, 3, 1, 9)]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (_tiff([*SIZE, (273, 4, 2**30, 8)]), "lists 42949673"),
        (_tiff([*SIZE, *((300 + at, 7, 5000, 8) for at in range(2000))]) + bytes(10_000), "lists 1000000"),
        (_tiff([*SIZE, (256, 4, 1, 60_000)]), "says twice"),
        (_tiff([(256, 12, 1, 9), (257, 4, 1, 9)]), "one whole number each"),
        (_tiff([(256, 4, 2, 9), (257, 4, 1, 9)]), "one whole number each"),
        (_tiff(SIZE, following=8), "more than 16 pictures"),
        (_tiff(SIZE, following=5000), "truncated"),
        (_tiff([]), "0 entries"),
        (b"II*\0\xff\xff\xff\xff", "truncated"),
        (b"II+\0\x08\0\0\0" + b"\xff" * 8, "truncated"),
        (b"MM", "truncated"),
    ],
)
def test_directories_that_are_traps_are_refused(content: bytes, said: str) -> None:
    assert said in str(tiff_fault(content))


@pytest.mark.parametrize("large", [False, True])
@pytest.mark.parametrize("order", ["<", ">"])
def test_directories_of_honest_files_are_sound(tmp_path: Path, large: bool, order: Any) -> None:
    levels = np.random.default_rng(4).integers(0, 65536, (40, 32)).astype(np.uint16)
    note = "a note" * 50  # beside which tifffile writes a second one
    tifffile.imwrite(tmp_path / "a.tif", levels, bigtiff=large, byteorder=order, tile=(16, 16), description=note)
    assert tiff_fault((tmp_path / "a.tif").read_bytes()) is None
    if not large or order == "<":  # Pillow knows no other large files
        np.testing.assert_array_equal(read_image(tmp_path / "a.tif").grey, levels)


def test_a_tiff_with_notes_loads(tmp_path: Path, colour: NDArray[np.uint8]) -> None:
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    tags[270] = "a note" * 10_000
    (tmp_path / "a.tif").write_bytes(_saved(colour, "TIFF", tiffinfo=tags, icc_profile=bytes(100_000)))
    np.testing.assert_array_equal(read_levels(tmp_path / "a.tif"), colour)


def _may(pixels: tuple[int, int], file_bytes: int, kind: str, pixel_bytes: int = 1) -> bool:
    return size_fault(*pixels, file_bytes, kind=kind, pixel_bytes=pixel_bytes) is None


def test_what_may_be_declared_follows_the_size_of_the_file() -> None:
    assert _may((4000, 4000), 100, "TIFF")
    assert not _may((4000, 4001), 100, "TIFF")
    few, many = 64_000_000 // PIXELS_A_BYTE - 1, 64_000_000 // PIXELS_A_BYTE + 1
    assert _may((8000, 8000), many, "TIFF")
    assert not _may((8000, 8000), few, "TIFF")
    assert _may((8000, 8000), few, "PNG", 3)
    assert not _may((8000, 8000), few, "PNG", 4)
    assert not _may((8000, 8000), 64_000_000 // 1032, "PNG")  # fewer bytes than any packing takes
    assert not _may((8000, 8000), 64_000_000 // 512 - 1, "JPEG")
    assert not _may((LARGEST_PIXELS + 1, 1), 10**9, "PNG")
    assert FREE_PIXELS < LARGEST_PIXELS


def _large_png(rows: bytes, rows_declared: int) -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    packed = zlib.compress(rows, 1)
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 5000, rows_declared, 16, 6, 0, 0, 0))
    half = len(packed) // 2
    return (
        b"\x89PNG\r\n\x1a\n"
        + header
        + chunk(b"IDAT", packed[:half])
        + chunk(b"IDAT", packed[half:])
        + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize(("columns", "rows"), [(1, 1), (3, 5), (8, 8), (17, 9), (33, 2)])
@pytest.mark.parametrize(
    ("depth", "colour", "channels"), [(8, 0, 1), (16, 0, 1), (1, 0, 1), (4, 3, 1), (8, 2, 3), (16, 6, 4)]
)
def test_a_png_must_hold_every_byte_of_its_pixels(
    columns: int, rows: int, depth: int, colour: int, channels: int, interlaced: bool
) -> None:
    def file(size: int) -> bytes:
        parts = (
            (b"IHDR", struct.pack(">IIBBBBB", columns, rows, depth, colour, 0, 0, interlaced)),
            (b"IDAT", zlib.compress(bytes(size))),
            (b"IEND", b""),
        )
        chunks = (struct.pack(">I", len(data)) + kind + data + bytes(4) for kind, data in parts)
        return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)

    if interlaced:  # as the specification of PNG draws it, pixel by pixel
        pattern = ["16462646", "77777777", "56565656", "77777777", "36463646", "77777777", "56565656", "77777777"]
        passes = [pattern[row % 8][column % 8] for row in range(rows) for column in range(columns)]
        size = 0
        for each in "1234567":
            lines = {row for row in range(rows) if any(pattern[row % 8][c % 8] == each for c in range(columns))}
            wide = passes.count(each) // len(lines) if lines else 0
            size += len(lines) * (1 + -(-wide * channels * depth // 8))
    else:
        size = rows * (1 + -(-columns * channels * depth // 8))
    assert not rows_missing(file(size))
    assert rows_missing(file(size - 1))


def test_pixels_that_are_missing_are_seen_before_memory_is_taken_for_them(tmp_path: Path) -> None:
    row = bytes(1 + 8 * 5000)
    assert not rows_missing(_large_png(row * 1000, 1000))
    assert rows_missing(_large_png(row * 999 + row[:-1], 1000))
    broken = bytearray(_large_png(row * 1000, 1000))
    broken[60:90] = bytes(30)
    assert rows_missing(bytes(broken))
    (tmp_path / "a.png").write_bytes(_large_png(row * 900, 1000))
    with pytest.raises(FileInputError, match="must hold all pixels that it declares"):
        read_image(tmp_path / "a.png")


def test_the_end_marker_of_a_thumbnail_does_not_end_the_file() -> None:
    thumbnail = b"\xff\xd8\xff\xda\x00\x02\xff\xd9"
    body = b"\xff\xe1" + (len(thumbnail) + 2).to_bytes(2, "big") + thumbnail
    start = b"\xff\xd8" + body + b"\xff\xda\x00\x02" + b"\x12\xff\x00\x34\xff\xd0\x56"
    assert jpeg_fault(start + b"\xff\xd9") is None
    assert "truncated" in str(jpeg_fault(start))


def test_bytes_after_the_end_of_a_jpeg_are_allowed(colour: NDArray[np.uint8]) -> None:
    assert jpeg_fault(_saved(colour, "JPEG") + b"maker's own bytes") is None
