"""Pictures become grey levels exactly or are refused in one sentence; one that was cut short never becomes pixels."""

from __future__ import annotations

import hashlib
import io
import os
import struct
import zlib
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
import tifffile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from tsis.errors import FileInputError, InputError
from tsis.files.images import (
    FREE_PIXELS,
    LARGEST_PIXELS,
    PIXELS_A_BYTE,
)
from tsis.instrument.image_files import png_bytes, read_image, read_levels, whole_levels
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from tests.instrument.conftest import Write


LUMA = np.array([0.2126, 0.7152, 0.0722])
LOSSLESS = ("png", "bmp", "tif")


@pytest.mark.parametrize("suffix", LOSSLESS)
def test_grey_levels_written_by_either_library_come_back_exactly(
    tmp_path: Path, write: Write, grey: NDArray[np.uint8], suffix: str
) -> None:
    by_opencv = write(f"opencv.{suffix}", grey)
    by_pillow = tmp_path / f"pillow.{suffix}"
    Image.fromarray(grey).save(by_pillow)
    for path in (by_opencv, by_pillow):
        image = read_image(path)
        np.testing.assert_array_equal(image.grey, grey)
        assert image.full_scale == 255.0
        assert image.name == path.name
        assert image.settings["kind"] == "grey"


@pytest.mark.parametrize("suffix", LOSSLESS)
def test_colour_becomes_rec_709_luma(write: Write, colour: NDArray[np.uint8], suffix: str) -> None:
    path = write(f"colour.{suffix}", colour)
    np.testing.assert_allclose(read_image(path).grey, colour @ LUMA, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(read_levels(path), colour)


def test_a_grey_picture_stored_as_colour_keeps_its_levels_exactly(write: Write, grey: NDArray[np.uint8]) -> None:
    path = write("snapshot.bmp", np.dstack([grey] * 3))
    np.testing.assert_array_equal(read_image(path).grey, grey)


@pytest.mark.parametrize("suffix", ["png", "tif"])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_sixteen_bits_are_kept(tmp_path: Path, suffix: str, channels: int) -> None:
    shape = (9, 11) if channels == 1 else (9, 11, channels)
    levels = np.random.default_rng(2).integers(0, 65536, shape).astype(np.uint16)
    path = tmp_path / f"deep.{suffix}"
    assert cv2.imwrite(str(path), levels)
    image = read_image(path)
    assert image.full_scale == 65535.0
    assert image.settings["bits"] == 16
    expected = levels if channels == 1 else levels[..., 2::-1] @ LUMA
    np.testing.assert_allclose(image.grey, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("compression", ["raw", "tiff_lzw", "tiff_deflate", "packbits"])
@pytest.mark.parametrize("bits", [8, 16])
def test_tiff_of_every_lossless_compression(tmp_path: Path, compression: str, bits: int) -> None:
    levels = np.random.default_rng(3).integers(0, 2**bits, (40, 30)).astype(np.uint8 if bits == 8 else np.uint16)
    path = tmp_path / "frame.tif"
    Image.fromarray(levels).save(path, compression=compression)
    np.testing.assert_array_equal(read_image(path).grey, levels)


@pytest.mark.parametrize("byteorder", ["<", ">"])
@pytest.mark.parametrize("tile", [None, (16, 16)])
def test_tiff_of_a_third_library(tmp_path: Path, byteorder: Any, tile: tuple[int, int] | None) -> None:
    levels = np.random.default_rng(4).integers(0, 65536, (40, 30)).astype(np.uint16)
    path = tmp_path / "frame.tif"
    tifffile.imwrite(path, levels, byteorder=byteorder, tile=tile)
    np.testing.assert_array_equal(read_image(path).grey, levels)


@pytest.mark.parametrize("progressive", [False, True])
def test_jpeg_agrees_with_opencv(tmp_path: Path, progressive: bool) -> None:
    rows, columns = np.mgrid[:48, :64]
    smooth = (127 + 100 * np.sin(rows / 9) * np.cos(columns / 7)).astype(np.uint8)
    path = tmp_path / "frame.jpg"
    Image.fromarray(smooth).save(path, quality=90, progressive=progressive)
    peer = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert peer is not None
    assert np.abs(read_image(path).grey - peer).max() <= 1
    assert np.abs(read_image(path).grey - smooth).max() <= 8


def test_alpha_is_dropped(tmp_path: Path, grey: NDArray[np.uint8], colour: NDArray[np.uint8]) -> None:
    Image.fromarray(np.dstack([grey, grey[::-1]])).save(tmp_path / "grey.png")
    Image.fromarray(np.dstack([colour, grey])).save(tmp_path / "colour.png")
    np.testing.assert_array_equal(read_image(tmp_path / "grey.png").grey, grey)
    np.testing.assert_array_equal(read_levels(tmp_path / "colour.png"), colour)


def test_scale_force_and_checksum_travel_with_the_image(write: Write, grey: NDArray[np.uint8]) -> None:
    path = write("frame.png", grey)
    image = read_image(path, mm_per_pixel=(0.0084, 0.0098), force_n=1.2)
    assert image.mm_per_pixel == (0.0084, 0.0098)
    assert image.force_n == 1.2
    assert image.settings["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    with pytest.raises(InputError, match="force_n must lie in"):
        read_image(path, force_n=float("nan"))


def test_one_pixel_is_an_image(write: Write) -> None:
    path = write("dot.png", np.array([[7]], np.uint8))
    assert read_image(path).grey.tolist() == [[7.0]]


def _refused(path: Any) -> str:
    with pytest.raises(FileInputError) as caught:
        read_image(path)
    message = str(caught.value)
    assert "\n" not in message
    return message


def _deep_palette_and_others(folder: Path, grey: NDArray[np.uint8]) -> dict[str, str]:
    picture = Image.fromarray(grey)
    picture.convert("1").save(folder / "one.png")
    Image.fromarray(np.dstack([grey, grey[::-1], grey])).convert("P").save(folder / "palette.png")
    Image.fromarray(grey.astype(np.float32)).save(folder / "float.tif")
    Image.fromarray(grey.astype(np.int32)).save(folder / "integer.tif")
    picture.convert("CMYK").save(folder / "cmyk.jpg")
    picture.save(folder / "two.tif", save_all=True, append_images=[picture])
    picture.save(folder / "frame.gif")
    return {
        "one.png": "1-bit black and white",
        "palette.png": "palette colours",
        "float.tif": "floating-point values",
        "integer.tif": "32-bit or signed integers",
        "cmyk.jpg": "CMYK colours",
        "two.tif": "must hold one picture; got 2",
        "frame.gif": "must be a PNG, JPEG, BMP or TIFF file",
    }


def test_unsupported_kinds_are_refused_by_name(tmp_path: Path, grey: NDArray[np.uint8]) -> None:
    for name, phrase in _deep_palette_and_others(tmp_path, grey).items():
        message = _refused(tmp_path / name)
        assert phrase in message
        assert name in message


def test_a_float_tiff_with_nan_is_refused(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "nan.tif", np.full((4, 4), np.nan, np.float32))
    assert "floating-point" in _refused(tmp_path / "nan.tif")


def test_hostile_paths_are_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("not an image\n" * 100)
    (tmp_path / "loop.png").symlink_to(tmp_path / "loop.png")
    assert "does not exist" in _refused(tmp_path / "absent.png")
    assert "got a folder" in _refused(tmp_path)
    assert "got an empty file" in _refused(tmp_path / "empty.png")
    assert "PNG, JPEG, BMP or TIFF" in _refused(tmp_path / "text.png")
    assert "null byte" in _refused("frame\0.png")
    assert "must name a readable file" in _refused("x" * 100_000)
    assert "must name a readable file" in _refused(tmp_path / "loop.png")
    assert len(_refused("x" * 100_000)) < 300
    with pytest.raises(InputError, match="must be the name of a file"):
        read_image(None)  # type: ignore[arg-type]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_devices_and_pipes_are_never_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    assert "device, pipe or socket" in _refused(tmp_path / "pipe.png")
    if Path("/dev/zero").exists():
        assert "device, pipe or socket" in _refused("/dev/zero")


def _png_of_declared_size(columns: int, rows: int) -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"\0" * 1000)) + chunk(b"IEND", b"")


@pytest.mark.parametrize("side", [8100, 10_000, 60_000, 2**31 - 1])
def test_a_huge_declared_size_is_refused_before_decoding(tmp_path: Path, side: int) -> None:
    path = tmp_path / "bomb.png"
    path.write_bytes(_png_of_declared_size(side, side))
    assert side**2 > LARGEST_PIXELS
    assert f"at most {LARGEST_PIXELS} pixels" in _refused(path)


def test_nothing_is_printed_whatever_the_bytes(
    tmp_path: Path, write: Write, grey: NDArray[np.uint8], capfd: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(5)
    for suffix in ("png", "jpg", "bmp", "tif"):
        data = np.frombuffer(write(f"frame.{suffix}", grey).read_bytes(), np.uint8)
        for _ in range(60):
            damaged = data.copy()
            damaged[rng.integers(0, damaged.size, 4)] = rng.integers(0, 256, 4)
            (tmp_path / "damaged").write_bytes(damaged[: rng.integers(1, data.size + 1)].tobytes())
            with suppress(FileInputError):
                read_image(tmp_path / "damaged")
    assert capfd.readouterr() == ("", "")


def test_a_changed_byte_in_a_png_is_seen(write: Write, grey: NDArray[np.uint8]) -> None:
    path = write("frame.png", grey)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    assert "checksum" in _refused(path)


def test_many_threads_may_read_at_once(write: Write, grey: NDArray[np.uint8]) -> None:
    path = write("frame.tif", grey)
    with ThreadPoolExecutor(8) as pool:
        for image in pool.map(read_image, [path] * 64):
            np.testing.assert_array_equal(image.grey, grey)


KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "png": ("PNG", {}),
    "jpeg": ("JPEG", {}),
    "progressive jpeg": ("JPEG", {"progressive": True}),
    "bmp": ("BMP", {}),
    "tiff": ("TIFF", {}),
    "tiff lzw": ("TIFF", {"compression": "tiff_lzw"}),
    "tiff deflate": ("TIFF", {"compression": "tiff_deflate"}),
}


@cache
def _file(kind: str, colour: bool) -> bytes:
    shape = (23, 19, 3) if colour else (23, 19)
    pixels = np.random.default_rng(6).integers(0, 256, shape).astype(np.uint8)
    file_format, options = KINDS[kind]
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, file_format, **options)
    return buffer.getvalue()


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=120, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_cut_file_is_refused_or_still_holds_every_pixel(
    tmp_path: Path, kind: str, colour: bool, share: float
) -> None:
    data = _file(kind, colour)
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    whole.write_bytes(data)
    cut.write_bytes(data[: int(share * len(data))])
    try:
        kept = read_image(cut)
    except FileInputError:
        return
    assert kind.startswith("tiff"), "only a TIFF may lose bytes that hold no pixel"
    np.testing.assert_array_equal(kept.grey, read_image(whole).grey)


def test_a_png_of_16_bit_colours_with_forged_notes_loads_in_silence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    encoded = cv2.imencode(".png", np.full((9, 9, 3), 1000, np.uint16))[1].tobytes()
    note = b"eXIf" + bytes(1000)
    forged = encoded[:33] + struct.pack(">I", 1000) + note + struct.pack(">I", zlib.crc32(note)) + encoded[33:]
    (tmp_path / "a.png").write_bytes(forged)
    assert (read_levels(tmp_path / "a.png") == 1000).all()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("deep", "hot"), [pytest.param(False, 0.0, marks=pytest.mark.slow), (False, 1e-4), (True, 1e-3)]
)
def test_a_dark_frame_is_read_back_by_what_wrote_it(tmp_path: Path, deep: bool, hot: float) -> None:
    rng = np.random.default_rng(4)
    grey = np.zeros((4096, 4096), np.uint16 if deep else np.uint8)
    grey.ravel()[rng.integers(0, grey.size, int(hot * grey.size))] = 3
    assert grey.size > FREE_PIXELS
    image = TactileImage(grey=grey, full_scale=65535.0 if deep else 255.0)
    content = png_bytes(image)
    assert len(content) * PIXELS_A_BYTE < grey.size or hot
    (tmp_path / "a.png").write_bytes(content)
    np.testing.assert_array_equal(read_image(tmp_path / "a.png").grey, grey)


def test_an_even_jpeg_that_packs_as_far_as_any_is_read(tmp_path: Path) -> None:
    Image.new("L", (4096, 4096)).save(tmp_path / "a.jpg", optimize=True, progressive=True)
    assert (tmp_path / "a.jpg").stat().st_size * PIXELS_A_BYTE < 4096**2
    assert read_image(tmp_path / "a.jpg").grey.shape == (4096, 4096)


def test_more_pixels_than_are_read_back_are_not_written() -> None:
    grey = np.broadcast_to(np.uint8(0), (65_001, 1000))
    with pytest.raises(InputError, match="at most 65000000 pixels to be stored"):
        whole_levels(grey, 255.0)


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "options"), [("png", (cv2.IMWRITE_PNG_COMPRESSION, 1)), ("jpg", ())])
def test_an_honest_photograph_of_64_million_pixels_loads(tmp_path: Path, suffix: str, options: tuple[int, ...]) -> None:
    rng, (rows, columns) = np.random.default_rng(5), (6936, 9248)
    smooth = cv2.resize(
        rng.integers(30, 200, (30, 40)).astype(np.uint8), (columns, rows), interpolation=cv2.INTER_CUBIC
    )
    noise = np.tile(rng.integers(0, 5, (rows // 8, columns // 8)).astype(np.uint8), (8, 8))
    assert cv2.imwrite(str(tmp_path / f"a.{suffix}"), cv2.add(smooth, noise), options)
    assert read_image(tmp_path / f"a.{suffix}").grey.shape == (rows, columns)
