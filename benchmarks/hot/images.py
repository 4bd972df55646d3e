"""Images: frames of the virtual camera, and image files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from benchmarks.camera import SENSOR, galsim_noise, uneven_light, whole_frames
from benchmarks.harness import Contest, Side, missing, timed, version
from PIL import Image

import tsis
from tsis.imaging.sensor import expose
from tsis.instrument.image_files import read_image

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from benchmarks.harness import Place

READ = ("png", "bmp", "jpg", "tif")


def frames(_place: Place) -> Iterator[Contest]:
    """A whole frame of 768 x 492 pixels, and its noise."""
    field = tsis.mechanics.press(tsis.load_probe("tsis-2011"), tsis.load_phantom("size-8"), force_n=1.0)
    rng = np.random.default_rng(1)
    ours, plain = whole_frames(field, uneven_light(), rng)
    yield Contest(
        task="a camera frame of 768 x 492",
        own=Side(program="tsis", seconds=timed(ours)),
        peers=(Side(program=f"NumPy {np.__version__}, SciPy {version('scipy')}", seconds=timed(plain)),),
    )
    picture, reason = ours(), missing("galsim")
    yield Contest(
        task="noise of a frame, rounded and clipped",
        own=Side(program="tsis", seconds=timed(lambda: expose(picture, SENSOR, rng))),
        peers=tuple(
            Side(program=name, seconds=timed(call), note="the other neither rounds nor clips")
            for name, call in ([] if reason else galsim_noise(picture))
        ),
        absent=(("GalSim", reason),) if reason else (),
    )


def reading(place: Place) -> Iterator[Contest]:
    """Image files of 768 x 492, with every check that a file from anywhere needs."""
    named = {"OpenCV": f"OpenCV {cv2.__version__}", "Pillow": f"Pillow {version('pillow')}"}
    for suffix in READ:
        calls = readers(frame_file(place.folder, suffix))
        yield Contest(
            task=f"reading a {suffix.upper()} file of 768 x 492",
            own=Side(program="tsis", seconds=timed(calls["tsis"])),
            peers=tuple(
                Side(program=program, seconds=timed(calls[name]), note="the other checks less")
                for name, program in named.items()
            ),
        )


def frame_file(folder: Path, suffix: str) -> Path:
    """A bright patch with noise, written by OpenCV."""
    rows, columns = np.mgrid[:492, :768]
    noise = np.random.default_rng(0).normal(0.0, 2.0, rows.shape)
    frame = (120 + 100 * np.exp(-((rows - 246) ** 2 + (columns - 384) ** 2) / 2e4) + noise).clip(0, 255)
    path = folder / f"frame.{suffix}"
    if not cv2.imwrite(str(path), frame.astype(np.uint8)):
        raise OSError(f"OpenCV did not write {path.name}")
    return path


def readers(path: Path) -> dict[str, Callable[[], object]]:
    """Calls that read the file, by program; the first is ours."""
    return {
        "tsis": lambda: read_image(path),
        "OpenCV": lambda: cv2.imread(str(path), cv2.IMREAD_UNCHANGED),
        "Pillow": lambda: np.asarray(Image.open(path)),
    }
