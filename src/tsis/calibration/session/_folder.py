"""Frames of a calibration session with their forces, and the folder that stores them."""

from __future__ import annotations

import csv
import io
import secrets
import shutil
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tsis.__about__ import CALIBRATION_FILE, RESEARCH_USE_ONLY
from tsis.calibration.file import (
    calibration_bytes,
    calibration_sha256,
    read_calibration,
)
from tsis.calibration.session._setup import SessionSetup, plan_steps
from tsis.errors import CalibrationError, FileInputError, InputError, TsisError
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import json_bytes
from tsis.files.json_values import from_json_value, to_json_value
from tsis.files.reading import as_path, one_line, printable_path, read_bytes, read_object
from tsis.instrument import png_bytes, read_image
from tsis.model.image import TactileImage
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.session._setup import CalibrationStep


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibrationFrame:
    """A frame of a calibration step.

    Parameters
    ----------
    image
        The raw camera frame.
    force_n
        Force of the gauge, newtons; None in steps without force.
    time_s
        Arrival time, seconds on the camera's or the computer's clock; None when unknown.
    """

    image: TactileImage
    force_n: float | None = None
    time_s: float | None = None

    def __post_init__(self) -> None:
        require_type("image", self.image, TactileImage)
        if self.force_n is not None:
            require_number("force_n", self.force_n, -100.0, 100.0, hint="newtons")
        if self.time_s is not None:
            require_number("time_s", self.time_s, -1e15, 1e15, hint="seconds")


FORMAT, VERSION = "tsis-calibration-session", 1
TERMS, INDEX = "session.json", "shots.csv"
LARGEST_TERMS_BYTES, LARGEST_INDEX_BYTES, MOST_LINES = 2**20, 8 * 2**20, 100_000
COLUMNS = ("file", "time_s", "force_n", "full_scale")  # the last because a file of 16 bits may contain fewer


class SessionFolder:
    """A session's folder.

    Parameters
    ----------
    path
        The folder; it need not exist before `begin`.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = as_path(path)

    @property
    def begun(self) -> bool:
        """Whether it contains a session."""
        return (self.path / TERMS).exists()

    def begin(self, terms: SessionSetup) -> None:
        """Create the folder and write the terms.

        Raises `FileInputError` when it contains a session already or cannot be written.
        """
        if self.begun:
            raise FileInputError(
                f"{printable_path(self.path)} must hold no session yet; it does (go on with it, or choose another)"
            )
        document = {"format": FORMAT, "version": VERSION, "notice": RESEARCH_USE_ONLY, "terms": to_json_value(terms)}
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            write_durably(self.path / TERMS, json_bytes(document))
        except OSError as error:
            raise _refused(self.path, error, kind="folder") from error

    def terms(self) -> SessionSetup:
        """The terms of the session; `FileInputError` when they are missing or invalid."""
        file = self.path / TERMS
        document = read_object(file, most=LARGEST_TERMS_BYTES)
        if (document.get("format"), document.get("version")) != (FORMAT, VERSION):
            raise FileInputError(f"{printable_path(file)} must be a {FORMAT} of version {VERSION}; got another format")
        try:
            return from_json_value(SessionSetup, document.get("terms"), "terms")
        except InputError as error:
            raise FileInputError(f"{printable_path(file)} must be the terms of a session; got: {error}") from error

    def plan(self) -> tuple[CalibrationStep, ...]:
        """The session's steps."""
        terms = self.terms()
        return plan_steps(terms.tips_mm, repeats=terms.repeats, pads_kpa=terms.pads_kpa)

    def done(self, step: CalibrationStep) -> bool:
        """Whether all frames of the step are stored."""
        return (self.path / step.name / INDEX).exists()

    def missing(self) -> tuple[str, ...]:
        """Names of the required steps that are not done."""
        return tuple(step.name for step in self.plan() if not (step.optional or self.done(step)))

    def save(
        self,
        step: CalibrationStep,
        shots: Iterable[CalibrationFrame],
        *,
        progress: Callable[[int], None] = lambda stored: None,
    ) -> int:
        """Store the frames of a step, all or none, and return their number.

        Raises `CalibrationError` when there are none; `FileInputError` when they cannot be written, or the step was
        done before.
        """
        path, draft = self.path / step.name, self._hidden(step)
        try:
            if path.exists():
                cure = "remove it to repeat the step"
                raise FileInputError(f"{printable_path(path)} must be new; it exists already ({cure})")
            for killed in self.path.glob(f".{step.name}-*"):  # drafts of a killed program
                shutil.rmtree(killed, ignore_errors=True)
            draft.mkdir()
            stored = self._write(draft, shots, progress)
            draft.rename(path)
        except OSError as error:
            raise _refused(self.path, error, kind="folder") from error
        finally:
            shutil.rmtree(draft, ignore_errors=True)  # of an unfinished step
        return stored

    def count(self, step: CalibrationStep) -> int:
        """Number of frames of the step; 0 when it is not done."""
        return len(list((self.path / step.name).glob("frame-*.png"))) if self.done(step) else 0

    def forget(self, step: CalibrationStep) -> None:
        """Remove the frames of a step, if any, so that it can be repeated.

        Raises `FileInputError` when they cannot be removed; the step is still done then.
        """
        path = self.path / step.name
        if not path.exists():
            return
        try:
            # The rename makes the removal atomic.
            path.rename(going := self._hidden(step))
        except OSError as error:
            raise _refused(self.path, error, kind="folder") from error
        shutil.rmtree(going, ignore_errors=True)  # `save` removes the remainder

    def shots(self, step: CalibrationStep) -> list[CalibrationFrame]:
        """Read the frames of a step in the order of acquisition.

        Raises `CalibrationError` when the step was not done; `FileInputError` when a file is missing or damaged.
        """
        index, rows = self._rows(step)
        return [self._shot(index, row) for row in rows]

    def middle_shot(self, step: CalibrationStep) -> CalibrationFrame:
        """The middle frame of a step, in loadings near the largest force; errors as `shots`."""
        index, rows = self._rows(step)
        return self._shot(index, rows[len(rows) // 2])

    def _rows(self, step: CalibrationStep) -> tuple[Path, list[list[str]]]:
        """The step's table of frames, and its rows."""
        if not self.done(step):
            raise CalibrationError(
                f"step {step.name!r} must be done first; {printable_path(self.path)} holds no frames of it"
            )
        index = self.path / step.name / INDEX
        name, content = printable_path(index), read_bytes(index, most=LARGEST_INDEX_BYTES)
        if content.count(b"\n") + content.count(b"\r") > MOST_LINES:
            raise FileInputError(f"{name} must have at most {MOST_LINES} lines; it has more")
        try:
            rows = list(csv.reader(io.StringIO(content.decode("utf-8", errors="replace"))))
        except csv.Error as error:
            raise FileInputError(f"{name} must be a table of frames; got: {one_line(error)}") from error
        if not rows or tuple(rows[0]) != COLUMNS:
            raise FileInputError(f"{name} must begin with the line {','.join(COLUMNS)}")
        frames = [row for row in rows[1:] if row]
        if len({row[0] for row in frames}) < len(frames):  # a small file could otherwise take any amount of memory
            raise FileInputError(f"{name} must name each frame once; it names one twice")
        if not frames:
            raise FileInputError(f"{name} must name at least one frame; got none (remove the step, repeat it)")
        return index, frames

    def _write(self, draft: Path, shots: Iterable[CalibrationFrame], progress: Callable[[int], None]) -> int:
        lines = [",".join(COLUMNS)]
        for number, shot in enumerate(shots):
            name = f"frame-{number:04d}.png"
            (draft / name).write_bytes(png_bytes(shot.image))
            lines.append(f"{name},{_text(shot.time_s)},{_text(shot.force_n)},{_text(shot.image.full_scale)}")
            progress(number + 1)
        if len(lines) == 1:
            raise CalibrationError("a step must hold at least one frame; got none (does the camera deliver?)")
        write_durably(draft / INDEX, ("\n".join(lines) + "\n").encode())
        return len(lines) - 1

    def _shot(self, index: Path, row: list[str]) -> CalibrationFrame:
        try:
            name, time_s, force_n, full_scale = row
            if name != as_path(name).name:
                raise InputError(f"must name files of its own folder; got {name!r:.80}")
            image = replace(read_image(index.parent / name), full_scale=float(full_scale))
            return CalibrationFrame(image=image, time_s=_number(time_s), force_n=_number(force_n))
        except FileInputError:
            raise
        except ValueError as error:
            raise FileInputError(
                f"{printable_path(index)} must hold a file, a time, a force and a full scale a line; got: "
                f"{one_line(error)}"
            ) from error

    def _hidden(self, step: CalibrationStep) -> Path:
        """A new folder for frames of the step that do not count."""
        return self.path / f".{step.name}-{secrets.token_hex(4)}"


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.9g}"


def _number(text: str) -> float | None:
    return float(text) if text else None


SHORT = 12  # characters of an identity in file names


def saved_calibration(session: SessionFolder) -> Path | None:
    """The calibration file of the present frames; None before `save_calibration`."""
    file = session.path / CALIBRATION_FILE
    return file if file.exists() else None


def save_calibration(session: SessionFolder, calibration: ProbeCalibration) -> Path:
    """Write the calibration into the session's folder, over an earlier one, and return its file.

    Raises `FileInputError` when it cannot be written.
    """
    file = session.path / CALIBRATION_FILE
    content = calibration_bytes(calibration)
    try:
        write_durably(file, content)
    except OSError as error:
        raise _refused(file, error) from error
    return file


def archive_calibration(session: SessionFolder) -> Path | None:
    """Rename the calibration after its identity, because its frames change; return the new path, None without one.

    Results may cite it, so it is never removed; a damaged file gets a random name. Raises `FileInputError` when it
    cannot be renamed.
    """
    file = saved_calibration(session)
    if file is None:
        return None
    aside = file.with_name(f"calibration-{_cited(file)}.json")
    try:
        file.replace(aside)
    except OSError as error:
        raise _refused(file, error) from error
    return aside


def _cited(file: Path) -> str:
    try:
        return calibration_sha256(read_calibration(file))[:SHORT]
    except TsisError:  # a damaged file must not block the session or replace another
        return f"damaged-{secrets.token_hex(SHORT // 2)}"


def _refused(path: Path, error: OSError, *, kind: str = "file") -> FileInputError:
    reason = error.strerror or error
    return FileInputError(f"{printable_path(path)} must be a {kind} that can be written; got: {reason}")
