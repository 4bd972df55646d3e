"""Every error that tsis raises on purpose.

::

    TsisError
    ├── InputError          (also a ValueError) a value outside what the call accepts
    │   ├── UnknownNameError    a name that no catalog holds; the nearest one is suggested
    │   ├── FileInputError      a file that is missing, corrupt or of an unsupported kind
    │   └── ImageMismatchError  images that do not belong together
    ├── NotCalibratedError  an estimate that needs a calibration nobody gave
    ├── MechanicsError      a press that the chosen model cannot describe
    ├── SweepError          a sweep that cannot go on; what it has computed is kept
    ├── MissingExtraError   (also an ImportError) an optional library is not installed
    ├── CalibrationError    a calibration that cannot be made, or that may not be used
    ├── RecordsError        a store of records that cannot be opened, written or believed
    │   └── StaleRecordError    an edit of a record that somebody else has changed meanwhile
    ├── ControlError        an act of who does not hold the camera, or at a moment when it cannot be done
    ├── CameraError         a camera that cannot be opened or was lost
    └── GaugeError          a force gauge that cannot be opened, is silent, or says what is no force

    TsisWarning             (a UserWarning) something to mend that stops nothing
    └── RecordsWarning      a store of records that others can read

A message is one sentence: the name, the requirement, the value received and, where there is one, a cure.
"""

from __future__ import annotations

import importlib
from typing import Any


class TsisError(Exception):
    """The root of every error that tsis raises on purpose."""


class InputError(TsisError, ValueError):
    """A value outside what the call accepts."""


class UnknownNameError(InputError):
    """A name that no catalog holds; the message suggests the nearest one."""


class FileInputError(InputError):
    """A file that is missing, corrupt or of an unsupported kind."""


class ImageMismatchError(InputError):
    """Images that do not belong together: sizes, scales or value ranges differ."""


class NotCalibratedError(TsisError):
    """An estimate that needs a calibration nobody gave."""


class MechanicsError(TsisError):
    """A press that the chosen mechanical model cannot describe.

    Parameters
    ----------
    message
        The sentence, with a cure for who chooses the model.
    problem
        What is wrong alone, for who tells another cure; empty where it stands in the message only.
    largest_n
        Largest force that the model describes there, newtons; None where nobody has looked for it.
    """

    def __init__(self, message: str = "", *, problem: str = "", largest_n: float | None = None) -> None:
        super().__init__(message)
        self.problem, self.largest_n = problem, largest_n


class SweepError(TsisError):
    """A sweep that cannot go on; what it has computed is kept."""


class MissingExtraError(TsisError, ImportError):
    """An optional library is not installed; the message names it and the feature that needs it."""


class CalibrationError(TsisError):
    """A calibration that cannot be made from what was given, or that may not be used: expired, foreign, tampered."""


class RecordsError(TsisError):
    """A store of records that cannot be opened, written or believed; what was acknowledged is as it was."""


class StaleRecordError(RecordsError):
    """An edit of a record that somebody else has changed since it was read."""


class ControlError(TsisError):
    """An act in the console of who does not hold the camera, or at a moment when it cannot be done."""


class CameraError(TsisError):
    """A camera that cannot be opened or was lost."""


class GaugeError(TsisError):
    """A force gauge that cannot be opened, is silent, or says what is no force."""


class TsisWarning(UserWarning):
    """The root of every warning: something to mend that stops nothing."""


class RecordsWarning(TsisWarning):
    """A store of records that other users of the machine can read; the message gives the command that closes it."""


# What people call a package where its import name says something else; Netgen comes with NGSolve.
PRODUCT_NAMES = {"ngsolve": "NGSolve", "netgen": "NGSolve", "sklearn": "scikit-learn"}


def import_extra(name: str, *, feature: str, extra: str) -> Any:
    """Import ``name``, or say what needs it and which extra brings it.

    Parameters
    ----------
    name
        Of the module.
    feature
        What needs it, as the subject of a sentence.
    extra
        The extra of this package that brings it.

    Raises
    ------
    MissingExtraError
        When it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = name.partition(".")[0]
        raise MissingExtraError(
            f"{feature} needs {PRODUCT_NAMES.get(package, package)}, which is not installed; "
            f'install it with: python -m pip install "tsis[{extra}]"'
        ) from error
