"""``--probe``: a probe of the catalog by its name, or one of your own by its file."""

from __future__ import annotations

import re
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tsis.instrument.file_bytes import one_line, read_parsed
from tsis.model import Layer, list_probes, load_probe
from tsis.model.catalog import parse_probe
from tsis.model.check import require_one_of
from tsis.model.errors import InputError, NotCalibratedError
from tsis.model.light import Glass, Led
from tsis.model.variants import probe_variant

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from tsis.model import Probe

ENDING = ".toml"
LARGEST_FILE_BYTES = 64 * 2**10
MOST_LAYERS, MOST_LAMPS = 20, 100
LONGEST_KEY = 16  # parts
NAME = re.compile(r"\w[\w .,()+-]{0,59}")  # which every table, page and file shows as it is
KEYS = ("radius_mm", "layers", "face_curvature_mm", "sides", "glass", "leds", "assumed")


def is_file(probe: str) -> bool:
    """Whether ``--probe`` names a file and not an entry of the catalog."""
    return probe.lower().endswith(ENDING)


def given_probe(probe: str) -> Probe:
    """The probe that ``--probe`` names: one of the catalog, or that of a TOML file.

    Raises
    ------
    UnknownNameError
        When the catalog has no such probe.
    FileInputError
        When the file is missing, no TOML, holds not one probe, or a value that a probe cannot take.
    """
    return read_probe(Path(probe)) if is_file(probe) else load_probe(probe)


def calibrated_probe(name: str, *, unnamed: str) -> Probe:
    """The probe of the catalog that a calibration names, ``unnamed`` where it names none.

    Raises
    ------
    NotCalibratedError
        When the calibration is of a probe that the catalog does not have.
    """
    if name and name not in list_probes():
        raise NotCalibratedError(
            f"the calibration is of the probe {name!r:.80}, which is not in the catalog: give its file, as --probe "
            "mine.toml"
        )
    return load_probe(name or unnamed)


def given_lit_probe(probe: str, half_angle_deg: float | None, height_mm: float | None, aim_deg: float | None) -> Probe:
    """The probe that ``--probe`` names, with the given values of all lamps replaced where it is one of the catalog."""
    if not is_file(probe):
        return probe_variant(probe, half_angle_deg, height_mm, aim_deg)
    if (half_angle_deg, height_mm, aim_deg) != (None, None, None):
        raise InputError(
            f"--half-angle-deg, --height-mm and --aim-deg change the lamps of a probe of the catalog; got {probe}: "
            "change leds in that file"
        )
    return read_probe(Path(probe))


def require_no_file(what: str, probe: str | None) -> None:
    """Refuse a probe of a file where its name must mean the same later."""
    if probe is not None and is_file(probe):
        raise InputError(
            f"{what} needs a probe of the catalog, from which the estimate can be made again; got {probe}: leave "
            f"{what} out"
        )


def read_probe(file: Path) -> Probe:
    """The one probe of a TOML file, written as an entry of the catalog; errors as `given_probe`."""
    return read_parsed(file, _parsed, most=LARGEST_FILE_BYTES)


def _parsed(text: str) -> Probe:
    _require_short_keys(text)
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of 5000 digits is no error of TOML's
        raise InputError(f"a probe must be TOML; got: {one_line(error)}") from error
    entries = {name: value for name, value in document.items() if isinstance(value, dict)}
    if len(document) != 1 or len(entries) != 1:
        got = f"{one_line(', '.join(document)):.80}" if document else "nothing"
        raise InputError(f"it must hold one probe, a table under its name as [my-probe]; got {got}")
    ((name, entry),) = entries.items()
    if not NAME.fullmatch(name):
        raise InputError(
            f"the name must be up to 60 letters, digits, spaces and any of - _ . , ( ) +; got {name!r:.80}"
        )
    if name in list_probes():
        raise InputError(f"the name {name!r} is that of a probe of the catalog; choose another, as [my-{name}]")
    return parse_probe(name, _checked(entry))


def _require_short_keys(text: str) -> None:
    """Refuse a.b.c.d. ... without end, over which the parser takes the square of its length."""
    run = 0
    for part in text.split("."):
        run = 0 if any(mark in part for mark in "\n=,[]") else run + 1
        if run > LONGEST_KEY:
            raise InputError(f"keys must have at most {LONGEST_KEY} parts; got a longer one")


def _checked(entry: Mapping[str, Any]) -> dict[str, Any]:
    """The entry with nothing in it that a probe of the catalog does not have; values are checked by the probe."""
    _known("a probe", entry, KEYS)
    if "radius_mm" not in entry or "layers" not in entry:
        raise InputError(f"a probe must give radius_mm and layers; got {', '.join(entry) or 'nothing'}")
    for layer in _tables("layers", entry["layers"], MOST_LAYERS):
        _known("a layer", layer, (field.name for field in fields(Layer)))
        if not {"thickness_mm", "young_kpa"} <= set(layer):
            raise InputError(f"a layer must give thickness_mm and young_kpa; got {', '.join(layer) or 'nothing'}")
    for lamp in _tables("leds", entry.get("leds", []), MOST_LAMPS):
        _known("a lamp", lamp, (field.name for field in fields(Led)))
    (glass,) = _tables("glass", [entry.get("glass", {})], 1)
    _known("the glass", glass, (field.name for field in fields(Glass)))
    assumed = entry.get("assumed", [])
    if not isinstance(assumed, list) or not all(isinstance(name, str) for name in assumed):
        raise InputError(f"assumed must be a list of names of values; got {assumed!r:.80}")
    return dict(entry)


def _known(what: str, table: Mapping[str, Any], names: Iterable[str]) -> None:
    names = tuple(names)
    for key in table:
        require_one_of(f"value of {what}", key, names)


def _tables(name: str, value: Any, most: int) -> list[dict[str, Any]]:
    if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
        raise InputError(f"{name} must be tables, as {{ thickness_mm = 2.0 }}; got {value!r:.80}")
    if len(value) > most:
        raise InputError(f"{name} must be at most {most}; got {len(value)}")
    return value
