"""Priors as TOML files: those of the package, and a user's file that replaces one."""

from __future__ import annotations

from dataclasses import fields
from importlib.resources import files
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

from tsis.errors import InputError
from tsis.files.reading import as_path, parse_toml, read_parsed
from tsis.model.require import require_one_of, require_pair, require_type

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

Prior = TypeVar("Prior")
PRIORS = ("inclusion", "hardness")
INCLUSION_PRIORS: Mapping[str, str] = MappingProxyType(  # file of each shipped prior
    {"phantom-2011": "inclusion", "breast-ex-vivo": "breast-ex-vivo", "wide": "wide"}
)
CONTRAST = "contrast"  # in place of young_kpa: times the tissue's modulus
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


def list_inclusion_priors() -> tuple[str, ...]:
    """Names of the shipped priors of an inclusion; each file cites its source.

    Examples
    --------
    >>> list_inclusion_priors()
    ('phantom-2011', 'breast-ex-vivo', 'wide')
    """
    return tuple(INCLUSION_PRIORS)


def inclusion_prior_toml(name: str) -> str:
    """The file of a shipped prior of an inclusion, with its source; `UnknownNameError` when there is none."""
    require_one_of("prior", name, INCLUSION_PRIORS)
    return (files(__package__) / f"prior-{INCLUSION_PRIORS[name]}.toml").read_text(encoding="utf-8")


def read_prior_file(path: str | os.PathLike[str], kind: type[Prior]) -> Prior:
    """A prior from a TOML file whose keys are its fields; a missing key has its default.

    Parameters
    ----------
    path
        A file in the form of `default_prior_toml`, at most 64 KiB.
    kind
        `tsis.inclusion.InclusionPrior` or `tsis.hardness.posterior.HardnessPrior`.

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
    contrast = [CONTRAST] if "tissue_young_kpa" in names else []
    for name, value in values.items():
        require_one_of("value of the prior", name, names + contrast)
        if name == "name":
            require_type(name, value, str)
        else:
            _require_numbers(name, value)
    if CONTRAST in values:
        values = _from_contrast(values, kind)
    return kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})


def _from_contrast(values: dict[str, Any], kind: type[Prior]) -> dict[str, Any]:
    """The values with the range of the modulus for that of its ratio to the tissue's."""
    if "young_kpa" in values:
        raise InputError(f"the prior must state young_kpa or {CONTRAST}, not both")
    contrast = require_pair(CONTRAST, values[CONTRAST])
    tissue: float = values["tissue_young_kpa"] if "tissue_young_kpa" in values else _default(kind, "tissue_young_kpa")
    left = {name: value for name, value in values.items() if name != CONTRAST}
    return left | {"young_kpa": [ratio * tissue for ratio in contrast]}


def _default(kind: type[Prior], name: str) -> float:
    return float(next(field.default for field in fields(kind) if field.name == name))  # type: ignore[arg-type] # a dataclass


def _require_numbers(name: str, value: Any) -> None:
    parts = value if isinstance(value, list) else [value]
    if not all(isinstance(part, int | float) and not isinstance(part, bool) for part in parts):
        raise InputError(f"{name} must be a number, or a range as [1.0, 15.0]; got {value!r:.80}")
