"""Loaders of pictures and videos, with small files for each."""

from __future__ import annotations

import hashlib
import io
import tempfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from PIL import Image
from tests.hostile.loader import Loader
from tests.hostile.png_changed import forged

from tsis.instrument.drivers.files import ImageFiles, VideoFile
from tsis.instrument.image_files import read_image

if TYPE_CHECKING:
    from collections.abc import Hashable

    from numpy.typing import NDArray

MOST_FRAMES = 5
TIFFS = ("raw", "tiff_lzw", "tiff_deflate", "packbits")


def picture_loaders() -> tuple[Loader, ...]:
    """PNG, JPEG, BMP, TIFF, a folder of frames, and videos."""
    grey, colour = _levels(3), _levels(4, 3)
    deep = grey.astype(np.uint16) * 257
    deep_tiff = _cv(".tif", deep)
    png = (_cv(".png", grey), _cv(".png", colour), _cv(".png", deep), _cv(".png", np.dstack([deep] * 3)))
    return (
        Loader(name="picture, PNG", file="a.png", originals=png, load=_image, integrity=True, forge=forged),
        Loader(
            name="picture, JPEG",
            file="a.jpg",
            originals=(_pil(grey, "JPEG"), _pil(colour, "JPEG"), _pil(colour, "JPEG", progressive=True)),
            load=_image,
        ),
        Loader(name="picture, BMP", file="a.bmp", originals=(_cv(".bmp", grey), _cv(".bmp", colour)), load=_image),
        Loader(
            name="picture, TIFF",
            file="a.tif",
            originals=(
                *(_pil(levels, "TIFF", compression=kind) for levels in (grey, colour) for kind in TIFFS),
                deep_tiff,
            ),
            load=_image,
        ),
        Loader(
            name="folder of frames",
            file="frames/frame2.png",
            originals=png[:1],
            load=_folder,
            integrity=True,
            forge=forged,
            around={"frames/frame1.png": png[0]},
            share=0.5,
        ),
        Loader(
            name="video",
            file="a.avi",
            originals=(_video("MJPG", ".avi"), _video("mp4v", ".mp4")),
            load=_video_of,
            share=0.03,
        ),
    )


def _levels(seed: int, *channels: int) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (12, 17, *channels)).astype(np.uint8)


def _cv(suffix: str, levels: NDArray[Any]) -> bytes:
    return bytes(cv2.imencode(suffix, levels)[1].tobytes())


def _pil(levels: NDArray[Any], kind: str, **options: Any) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(levels).save(stream, kind, **options)
    return stream.getvalue()


def _video(codec: str, suffix: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 10.0, (32, 32))
        for seed in range(3):
            writer.write(np.kron(_levels(seed, 3)[:8, :8], np.ones((4, 4, 1), np.uint8)))
        writer.release()
        return path.read_bytes()


def token(values: NDArray[Any]) -> tuple[Hashable, ...]:
    """What tells one array from another."""
    return (values.shape, values.dtype.str, zlib.crc32(np.ascontiguousarray(values).data))


def _image(path: Path) -> Hashable:
    image = read_image(path)
    # what makes a changed BMP, JPEG or TIFF visible in every result
    assert image.settings["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    return (*token(image.grey), image.full_scale)


def _folder(path: Path) -> Hashable:
    source = ImageFiles(path.parent)
    source.open()
    source.start()
    return tuple(token(frame.pixels) for frame in source.frames())


def _video_of(path: Path) -> Hashable:
    source = VideoFile(path)
    source.open()
    try:
        source.start()
        return tuple(token(frame.pixels) for frame, _ in zip(source.frames(), range(MOST_FRAMES), strict=False))
    finally:
        source.stop()
