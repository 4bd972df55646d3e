"""Presses as commands take them: frames with options, or a folder."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.__about__ import CALIBRATION_FILE
from tsis.cli.options import chosen_scale, read_frames, reference_forces, target_forces
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.calibration.frames import UsableCalibration
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


Frames = Annotated[
    list[Path],
    typer.Argument(
        metavar="FOLDER|FRAME...",
        help="A folder of tsis demo, acquire or records export, which tells forces, scale and kinds; or frames of the "
        "pressed probe: PNG, JPEG, BMP or TIFF.",
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawPresses:
    """Raw frames: presses on the target and on tissue without inclusion, the untouched probe; a calibration, if any.

    A frame without force has that of the calibration's force line. ``probe`` is None where nothing names it.
    """

    images: list[TactileImage]
    reference: list[TactileImage]
    untouched: list[TactileImage]
    probe: Probe | None
    calibration: UsableCalibration | None


def folder_of(paths: Sequence[Path]) -> Path | None:
    """The folder, where the command line names one and no frames."""
    return paths[0] if len(paths) == 1 and os.path.isdir(paths[0]) else None  # noqa: PTH112 - False for any name


def read_calibration_of(paths: Sequence[Path], calibration: Path | None) -> UsableCalibration | None:
    """The calibration of the option, else that of the folder; None without both.

    Raises `FileInputError` when both are missing because a path does not exist.
    """
    folder = folder_of(paths)
    absent = None if calibration is not None else next((path for path in paths if not path.exists()), None)
    if absent is not None:
        raise tsis.files.reading.file_error(absent, "does not exist; check the name and the folder")
    if calibration is None and folder is not None and (folder / CALIBRATION_FILE).is_file():
        calibration = folder / CALIBRATION_FILE
    return None if calibration is None else tsis.calibration.frames.load_calibration(calibration)


def read_presses(
    paths: Sequence[Path],
    *,
    calibration: UsableCalibration | None = None,
    probe: Probe | None = None,
    scale_mm: str | None = None,
    force_n: Sequence[float] | None = None,
    reference: Path | None = None,
    reference_presses: Sequence[Path] | None = None,
    reference_force_n: Sequence[float] | None = None,
) -> RawPresses:
    """Read the frames; what options give replaces what a folder tells.

    Raises
    ------
    InputError
        When forces do not match the frames, or force and scale are not known where a calibration needs them.
    FileInputError, ImageMismatchError, CalibrationError
        As `tsis.load_frames`.
    """
    if reference_force_n and not reference_presses:
        raise InputError("--reference-force-n needs --reference-press, the presses whose force it tells")
    scale, folder = chosen_scale(calibration, scale_mm), folder_of(paths)
    on_tissue: list[TactileImage] = []
    untouched: list[TactileImage] = []
    if folder is None:
        forces = target_forces(force_n, len(paths)) if force_n else [None] * len(paths)
        images = read_frames(paths, forces, scale)
    else:
        found = tsis.calibration.frames.read_raw_frames(
            folder, calibration=calibration, probe=probe, mm_per_pixel=scale
        )
        images, on_tissue, untouched = list(found.images), list(found.reference), list(found.untouched)
        probe = found.probe
        if not images:
            raise InputError(f"{folder.name} must hold a press on the target; it holds none")
        if force_n:
            stated = target_forces(force_n, len(images))
            images = [replace(image, force_n=force) for image, force in zip(images, stated, strict=True)]
    if reference is not None:
        untouched = [tsis.calibration.frames.read_press_image(reference, mm_per_pixel=scale)]
    if reference_presses:
        known = [image.force_n for image in images if image.force_n is not None]
        told = bool(reference_force_n) or len(known) == len(images)
        count = len(reference_presses)
        on_tissue = read_frames(
            reference_presses,
            reference_forces(reference_force_n or (), known, count) if told else [None] * count,
            scale,
        )
    return RawPresses(images=images, reference=on_tissue, untouched=untouched, probe=probe, calibration=calibration)
