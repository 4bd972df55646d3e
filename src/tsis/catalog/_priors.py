"""Priors as TOML files: those of the package, and a user's file that replaces one."""

from __future__ import annotations

from dataclasses import fields
from importlib.resources import files
from typing import TYPE_CHECKING, Any, TypeVar

from tsis.errors import InputError
from tsis.files import as_path, parse_toml, read_parsed
from tsis.model import require_one_of

if TYPE_CHECKING:
    import os

Prior = TypeVar("Prior")
PRIORS = ("inclusion", "hardness")
LARGEST_FILE_BYTES = 64 * 2**10


def default_prior_toml(kind: str = "inclusion") -> str:
    """The default prior of an estimate as a TOML template with the meaning and the unit of each key.

    Parameters
    ----------
    kind
        ``"inclusion"`` or ``"hardness"``.

    Raises
    ------
    UnknownNameError
        When there is no such prior.

    Examples
    --------
    >>> "diameter_mm = [1.0, 15.0]" in default_prior_toml()
    True
    """
    require_one_of("prior", kind, PRIORS)
    return (files(__package__) / f"prior-{kind}.toml").read_text(encoding="utf-8")


def read_prior_file(path: str | os.PathLike[str], kind: type[Prior]) -> Prior:
    """A prior from a TOML file whose keys are its fields; a missing key has its default.

    Parameters
    ----------
    path
        A file in the form of `default_prior_toml`, at most 64 KiB.
    kind
        `tsis.inclusion.InclusionPrior` or `tsis.hardness.HardnessPrior`.

    Raises
    ------
    FileInputError
        When the file is missing or no TOML, or a key or a value is invalid.
    """
    return read_parsed(as_path(path), lambda text: parse_prior(text, kind), most=LARGEST_FILE_BYTES)


def parse_prior(text: str, kind: type[Prior]) -> Prior:
    """A prior from the text of such a file, or `InputError`."""
    values = parse_toml(text, what="a prior")
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type] # a dataclass
    for name, value in values.items():
        require_one_of("value of the prior", name, names)
        _require_numbers(name, value)
    return kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})


def _require_numbers(name: str, value: Any) -> None:
    parts = value if isinstance(value, list) else [value]
    if not all(isinstance(part, int | float) and not isinstance(part, bool) for part in parts):
        raise InputError(f"{name} must be a number, or a range as [1.0, 15.0]; got {value!r:.80}")
