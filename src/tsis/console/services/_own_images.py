"""The user's own image files: opened one by one, measured, and saved as presses of a target."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration import read_press_image
from tsis.errors import InputError, TsisError
from tsis.files.atomic import write_durably
from tsis.files.images import encode_picture
from tsis.files.reading import file_error, printable_name
from tsis.instrument import connect
from tsis.instrument.drivers import IMAGE_ENDINGS, VIDEO_ENDINGS
from tsis.model.require import require_one_of
from tsis.present.images import analyse_image
from tsis.records.importing import import_batches
from tsis.records.sources import ImportOptions, find_import_batches

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from tsis.present.images import ImageFinding
    from tsis.records.store import Store


SIDECAR = ".json"
OPENABLE = (*IMAGE_ENDINGS, *VIDEO_ENDINGS, SIDECAR)
MOST_OWN_FRAMES = 500  # of one page
UNTOUCHED = "untouched"
IMAGE_ROLES = ("target", "plain", UNTOUCHED)  # an untouched frame is the reference of a measurement


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnImage:
    """One frame of the user: its file, size in pixels, what was pressed, and its force where known, newtons."""

    path: Path
    rows: int
    columns: int
    role: str = IMAGE_ROLES[0]
    force_n: float | None = None

    def __post_init__(self) -> None:
        require_one_of("role", self.role, IMAGE_ROLES)

    @property
    def name(self) -> str:
        """The file's name."""
        return printable_name(self.path)


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenedImages:
    """The frames that could be read, and a message for each file that could not."""

    images: tuple[OwnImage, ...] = ()
    refused: tuple[str, ...] = ()


def open_images(paths: Sequence[Path], *, frames_in: Path) -> OpenedImages:
    """Read image files, videos and the image files of folders; a bad file becomes a message and the others stay.

    The frames of a video are written below ``frames_in`` as grey PNG files of 8 bits. Sidecars of ``tsis acquire`` are
    read with the image that they lie beside.
    """
    images: list[OwnImage] = []
    refused: list[str] = []
    for path in paths:
        try:
            for file in _image_files(path, frames_in):
                if len(images) >= MOST_OWN_FRAMES:
                    raise file_error(file, f"is left out: at most {MOST_OWN_FRAMES} frames are opened at once")
                try:
                    rows, columns = read_press_image(file).grey.shape
                    images.append(OwnImage(path=file, rows=rows, columns=columns))
                except TsisError as error:
                    refused.append(str(error))
        except (TsisError, OSError) as error:  # a folder may be closed to us, a disk full
            refused.append(str(error))
    within = f"{frames_in}/"  # the folder of uploads says nothing to a user
    return OpenedImages(images=tuple(images), refused=tuple(message.replace(within, "") for message in refused))


def _image_files(path: Path, frames_in: Path) -> Iterator[Path]:
    ending = path.suffix.lower()
    if path.is_dir():
        files = sorted(item for item in path.iterdir() if item.suffix.lower() in (*IMAGE_ENDINGS, *VIDEO_ENDINGS))
        if not files:
            raise file_error(path, "must hold image files or videos; it holds none")
        for file in files:
            yield from _image_files(file, frames_in)
    elif ending in VIDEO_ENDINGS:
        yield from _video_frames(path, frames_in)
    elif ending in IMAGE_ENDINGS:
        yield path
    elif ending != SIDECAR:
        raise file_error(path, f"must be an image, a video or a sidecar ({', '.join(OPENABLE)}); got {ending!r:.20}")


def _video_frames(path: Path, frames_in: Path) -> Iterator[Path]:
    camera = connect(f"video:{path}")
    try:
        camera.open()
        camera.start()
        for index, frame in enumerate(camera.frames()):
            file = frames_in / f"{path.stem}-{index:05d}.png"
            write_durably(file, encode_picture(np.rint(frame.pixels).astype(np.uint8)))
            yield file
    finally:
        camera.stop()


def measure_images(
    images: Sequence[OwnImage], *, mm_per_pixel: tuple[float, float] | None, invert: bool = False
) -> tuple[tuple[ImageFinding, ...], tuple[str, ...]]:
    """The contact in each pressed image, against the first untouched frame if there is one, and what failed."""
    untouched = next((image for image in images if image.role == UNTOUCHED), None)
    reference = None if untouched is None else read_press_image(untouched.path, mm_per_pixel=mm_per_pixel)
    findings: list[ImageFinding] = []
    failed: list[str] = []
    for image in (item for item in images if item.role != UNTOUCHED):
        try:
            frame = read_press_image(image.path, mm_per_pixel=mm_per_pixel, force_n=image.force_n)
            findings.append(analyse_image(frame, reference, invert=invert))
        except TsisError as error:
            failed.append(f"{image.name}: {error}")
    return tuple(findings), tuple(failed)


def save_images(
    store: Store, images: Sequence[OwnImage], *, number: int | None, options: ImportOptions
) -> tuple[int, int]:
    """Save the frames as presses of target ``number``, of the next free one when None; gives (target, presses added).

    ``options`` has scale, calibration and probe of all; role and force are those of each frame. Nothing is saved when a
    file cannot be. Raises as `tsis.records.sources.find_import_batches` and `import_batches`.
    """
    if not images:
        raise InputError("a target needs at least one image; open some first")
    batches = [
        batch
        for image in images
        for batch in find_import_batches(
            [image.path], replace(options, role=image.role, force_n=() if image.force_n is None else (image.force_n,))
        )
    ]
    number = number or max((item.target.number for item in store.targets(hidden=True)), default=0) + 1
    return number, sum(item.added for item in import_batches(store, batches, target=number))
