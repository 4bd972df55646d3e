"""How the program ends, for scripts and shells."""

from __future__ import annotations

from tsis.errors import (
    CalibrationError,
    InputError,
    MechanicsError,
    MissingExtraError,
    NotCalibratedError,
    NotIdentifiedError,
    TsisError,
    UntrustedError,
)

FAILED = 1  # a camera, a store or a check failed; one message says why
BAD_INPUT = 2  # one message says what was wrong
WITHHELD = 3  # the result must not be trusted, or the calculation was refused
INTERRUPTED = 130  # Ctrl-C, as shells have it
REFUSALS = (NotCalibratedError, UntrustedError, NotIdentifiedError, CalibrationError, MechanicsError)


def exit_code_of(error: TsisError) -> int:
    """The exit code of a command that ends with this error."""
    if isinstance(error, (InputError, MissingExtraError)):
        return BAD_INPUT
    return WITHHELD if isinstance(error, REFUSALS) else FAILED
