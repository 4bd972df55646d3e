"""The errors and warnings of tsis.

::

    TsisError
    ├── InputError          (also a ValueError) an invalid value
    │   ├── UnknownNameError    an unknown name; the nearest one is suggested
    │   ├── FileInputError      a file that is missing, corrupt or of an unsupported kind
    │   └── ImageMismatchError  images that do not belong together
    ├── NotCalibratedError  an estimate without the calibration that it needs
    ├── UntrustedError      a number of an estimate that is not trusted
    ├── NotIdentifiedError  the mean of a parameter that the data do not identify
    ├── MechanicsError      a press that the chosen model cannot describe
    ├── SweepError          a sweep that cannot continue; its results so far are saved
    ├── PluginError         a plug-in of another package that cannot be loaded or used
    ├── MissingExtraError   (also an ImportError) an optional library is not installed
    ├── CalibrationError    a calibration that cannot be computed, or must not be used
    ├── RecordsError        a store of records that cannot be opened, written or verified
    │   └── StaleRecordError    an edit of a record that another user has changed meanwhile
    ├── ControlError        a command by a client without control of the camera, or at an impossible moment
    ├── CameraError         a camera that cannot be opened or was lost
    └── GaugeError          a force gauge that cannot be opened, is silent, or sends no force

    TsisWarning             (a UserWarning) a problem that stops nothing
    └── RecordsWarning      a store of records that others can read

A message is one sentence: the name, the requirement, the value received and, where possible, a cure. An `InputError`
about one parameter has them as fields, too, of which pages make sentences of their own.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any


class TsisError(Exception):
    """The root of the errors of tsis."""


class InputError(TsisError, ValueError):
    """An invalid value.

    Parameters
    ----------
    message
        The message; made of the fields where it is empty.
    name
        Name of the parameter, as ``"gain"``; empty where the message is about several.
    requirement
        What it must be, as ``"must be a number"``; empty where the error has a message alone.
    value
        The value that was received, as the message shows it.
    hint
        Unit, or what the requirement is about, as ``"dB"`` or ``"number of the target"``.
    cure
        What was probably meant, or what to do.
    bounds
        Least and greatest value, where the requirement is a range.

    Examples
    --------
    >>> str(InputError(name="gain", requirement="must lie in [0, 24]", value="-5", hint="dB"))
    'gain must lie in [0, 24]; got -5 (dB)'
    """

    def __init__(
        self,
        message: str = "",
        *,
        name: str = "",
        requirement: str = "",
        value: str = "",
        hint: str = "",
        cure: str = "",
        bounds: tuple[float, float] | None = None,
    ) -> None:
        ending = (f"; got {value}" if value else "") + (f" ({hint})" if hint else "") + (f"; {cure}" if cure else "")
        super().__init__(message or f"{name} {requirement}{ending}")
        self.name, self.requirement, self.value = name, requirement, value
        self.hint, self.cure, self.bounds = hint, cure, bounds


class UnknownNameError(InputError):
    """An unknown name; the message suggests the nearest one."""


class FileInputError(InputError):
    """A file that is missing, corrupt or of an unsupported kind."""


class ImageMismatchError(InputError):
    """Images that do not belong together: sizes, scales or value ranges differ."""


class NotCalibratedError(TsisError):
    """An estimate without the calibration that it needs."""


class UntrustedError(TsisError):
    """A number of an estimate that is not trusted; the message gives the reasons and the cures."""


class NotIdentifiedError(TsisError):
    """The mean or standard deviation of a parameter that the data do not identify."""


class MechanicsError(TsisError):
    """A press that the chosen mechanical model cannot describe.

    Parameters
    ----------
    message
        The message, with a cure for callers that choose the model.
    problem
        The message without the cure, for callers with another cure; may be empty.
    largest_n
        Largest force that the model describes there, newtons; None where unknown.
    """

    def __init__(self, message: str = "", *, problem: str = "", largest_n: float | None = None) -> None:
        super().__init__(message)
        self.problem, self.largest_n = problem, largest_n


class SweepError(TsisError):
    """A sweep that cannot continue; its results so far are saved."""


class PluginError(TsisError):
    """A plug-in of another package that cannot be loaded, or is not what its kind requires."""


class MissingExtraError(TsisError, ImportError):
    """An optional library is not installed; the message names it and the feature that needs it."""


class CalibrationError(TsisError):
    """A calibration that cannot be computed, or must not be used: expired, of another probe, or altered."""


class RecordsError(TsisError):
    """A store of records that cannot be opened, written or verified; saved data stay intact."""


class StaleRecordError(RecordsError):
    """An edit of a record that another user has changed since it was read."""


class ControlError(TsisError):
    """A command by a client without control of the camera, or at an impossible moment."""


class CameraError(TsisError):
    """A camera that cannot be opened or was lost."""


class GaugeError(TsisError):
    """A force gauge that cannot be opened, is silent, or sends no force."""


class TsisWarning(UserWarning):
    """The root of the warnings of tsis: problems that stop nothing."""


class RecordsWarning(TsisWarning):
    """A store of records that other users of the machine can read; the message gives the command that closes it."""


# Product names that differ from import names; Netgen is part of NGSolve.
PRODUCT_NAMES = {
    "arviz": "ArviZ",
    "cv2": "OpenCV",
    "netgen": "NGSolve",
    "ngsolve": "NGSolve",
    "nicegui": "NiceGUI",
    "reportlab": "ReportLab",
    "sklearn": "scikit-learn",
    "sqlalchemy": "SQLAlchemy",
}


def import_extra(name: str, *, feature: str, extra: str) -> Any:
    """Import the module ``name``; `MissingExtraError` names the ``feature`` that needs it and the ``extra`` with it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise _missing(name, feature, extra) from error


def require_extra(*names: str, feature: str, extra: str) -> None:
    """Refuse, as `import_extra` does, to go on without the modules ``names``; they are not imported."""
    for name in names:
        try:
            installed = importlib.util.find_spec(name) is not None
        except ImportError:
            installed = False
        if not installed:
            raise _missing(name, feature, extra)


def _missing(name: str, feature: str, extra: str) -> MissingExtraError:
    package = name.partition(".")[0]
    return MissingExtraError(
        f"{feature} needs {PRODUCT_NAMES.get(package, package)}, which is not installed; "
        f'install it with: python -m pip install "tsis[{extra}]"'
    )
