"""A calibration from values that a laboratory measured by other means."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

from tsis.calibration.file._value import ProbeCalibration
from tsis.errors import FileInputError, InputError
from tsis.files import from_json_value, printable_path, read_object

if TYPE_CHECKING:
    from pathlib import Path


LARGEST_VALUES_BYTES = 2**20
BY_HAND = ("response", "scale")  # parts that can be entered by hand
FROM_FRAMES = ("reference", "force_line", "specification", "made", "expires")


def read_handwritten_calibration(path: Path, days: float) -> ProbeCalibration:
    """Read values that were entered by hand, and date them from now.

    Raises `FileInputError` when the file is invalid, or contains parts that only a session's frames provide.

    Parameters
    ----------
    path
        JSON file with name, probe, and a response or a scale.
    days
        Validity of the calibration, days.
    """
    content = read_object(path, most=LARGEST_VALUES_BYTES)
    if measured := [name for name in FROM_FRAMES if content.get(name) is not None]:
        raise FileInputError(
            f"{printable_path(path)} must hold values written by hand (name, probe, camera, settings, response, "
            f"scale); got {', '.join(measured)}, which a session's frames give and whose date cannot be renewed "
            "(tsis calibrate)"
        )
    now = datetime.now(UTC).replace(microsecond=0)
    dated: dict[str, Any] = {**content, "made": now.isoformat(), "expires": (now + timedelta(days=days)).isoformat()}
    try:
        calibration = from_json_value(ProbeCalibration, dated, "calibration")
    except InputError as error:
        raise FileInputError(f"{printable_path(path)}: {error}") from error
    if all(getattr(calibration, part) is None for part in BY_HAND):
        raise FileInputError(f"{printable_path(path)} must hold at least one of {', '.join(BY_HAND)}; got none")
    return calibration
