"""The calibration of a probe as one value and one file: versioned, hashed and checked before use.

The file is JSON with a version and the hash of its content, from a session or written by hand.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.calibration.camera_reference import CameraReference
from tsis.calibration.force_line import ForceLine
from tsis.calibration.scale import PixelScale
from tsis.calibration.specification import Specification
from tsis.errors import CalibrationError, FileInputError, InputError
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import content_sha256, json_bytes
from tsis.files.json_values import from_json_value, require_bounded_arrays, to_json_value, without_packed_arrays
from tsis.files.reading import as_path, parse_object, printable_path, read_object
from tsis.model.calibration import Calibration
from tsis.model.content import ContentValue
from tsis.model.exchange import summary_html
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from tsis.calibration.measured import MeasuredValue


LONGEST_NAME, LONGEST_NOTE = 200, 1000
YEARS = (2000, 2200)  # any time in these years can be converted to another zone and extended
MEASURED_IN: Mapping[str, tuple[tuple[str, str], ...]] = MappingProxyType(
    {
        "reference": tuple((f"{name}_grey", "grey") for name in ("read_noise", "shot_noise", "stray", "patch")),
        "force_line": (
            ("intercept_grey", "grey"),
            ("slope_grey_per_n", "grey/N"),
            ("residual_grey", "grey"),
            ("residual_share", ""),
        ),
    }
)
NEVER_NEGATIVE = ("read_noise_grey", "shot_noise_grey", "patch_grey", "residual_grey", "residual_share")


def require_name(what: str, text: object, *, longest: int = LONGEST_NAME) -> None:
    """Refuse a value that is not printable text on one line."""
    if not isinstance(text, str):
        raise InputError(name=what, requirement="must be a str", value=f"{text!r:.80}")
    if len(text) > longest:
        raise InputError(name=what, requirement=f"must hold at most {longest} characters", value=str(len(text)))
    if not text.isprintable():
        raise InputError(name=what, requirement="must be printable, on one line", value=f"{text!r:.80}")


def require_time(what: str, moment: object) -> None:
    """Refuse a time without a zone or in an impossible year; None is accepted."""
    if moment is None:
        return
    if not isinstance(moment, datetime) or moment.tzinfo is None:
        raise InputError(f"{what} must be a time with its zone; got {moment!r:.60}")
    if not YEARS[0] <= moment.year <= YEARS[1]:
        raise InputError(f"{what} must lie in the years {YEARS[0]} to {YEARS[1]}; got {moment.isoformat()}")


def _require_measured(part: str, value: Any) -> None:
    """Refuse a part with a measured number in another unit, or negative where only 0 or more is possible."""
    for name, unit in MEASURED_IN.get(part, ()):
        number: MeasuredValue | None = getattr(value, name)
        if number is None:
            continue
        _require_unit(f"{part}.{name}", number, unit)
        if name in NEVER_NEGATIVE and number.value < 0:
            raise InputError(f"{part}.{name} must not be negative; got {number.value:g}")


def _require_sheet(sheet: Specification) -> None:
    """Refuse a sheet with unprintable rows, or with numbers in another unit than their row."""
    for number, row in enumerate(sheet.rows):
        where = f"specification.rows[{number}]"
        for name in ("quantity", "unit", "fingertip", "printed", "note"):
            require_name(f"{where}.{name}", getattr(row, name), longest=LONGEST_NOTE)
        if row.measured is not None:
            _require_unit(f"{where}.measured", row.measured, row.unit)


def _require_unit(where: str, number: MeasuredValue, unit: str) -> None:
    if number.unit != unit:
        raise InputError(f"{where} must be in {unit or 'no unit, a pure number'}; got {number.unit!r:.40}")


Part = TypeVar("Part", PixelScale, CameraReference, ForceLine, Calibration, Specification)
SETTING_TOLERANCE = 1e-3  # relative rounding of settings by the camera


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProbeCalibration(ContentValue):
    """The calibration of a probe and its camera; a part that was not measured is None.

    Raises `InputError` when a part has the wrong type, probe or unit; when a time has no zone or the times are not in
    order; when a name is not printable on one line.

    Parameters
    ----------
    name
        Display name; printable, at most 200 characters.
    probe, camera
        Names of the calibrated probe and camera; empty when unknown, then not compared.
    settings
        Camera settings of the calibration, by name.
    made, expires
        Creation and expiry time with their time zone; None for a simulated calibration, which does not expire.
    scale
        Size of a pixel on the face.
    reference
        Grey levels without contact.
    force_line
        Force from the sum of grey levels.
    response
        Grey level against pressure, for the estimates.
    tissue
        The same on soft objects, with the light on dents, its errors, and the gain that belongs to it; presses on
        tissue use it.
    specification
        The specification sheet.

    Examples
    --------
    >>> calibration = ProbeCalibration(name="bench", probe="tsis-2011", made=datetime(2026, 11, 22, tzinfo=UTC),
    ...     expires=datetime(2027, 5, 22, tzinfo=UTC))
    >>> calibration.require_usable(datetime(2027, 6, 1, tzinfo=UTC))
    Traceback (most recent call last):
    ...
    tsis.errors.CalibrationError: calibration 'bench' must not be expired; it was good until 2027-05-22 (make a \
new one: tsis calibrate)
    """

    name: str
    probe: str = ""
    camera: str = ""
    settings: Mapping[str, float] = field(default_factory=dict)
    made: datetime | None = None
    expires: datetime | None = None
    scale: PixelScale | None = None
    reference: CameraReference | None = None
    force_line: ForceLine | None = None
    response: Calibration | None = None
    tissue: Calibration | None = None
    specification: Specification | None = None

    def __post_init__(self) -> None:
        for name in ("name", "probe", "camera"):
            require_name(name, getattr(self, name))
        for name, kind in PARTS.items():
            if getattr(self, name) is not None:
                require_type(name, getattr(self, name), kind)
                _require_measured(name, getattr(self, name))
        self._require_one_probe()
        if self.specification is not None:
            _require_sheet(self.specification)
        for name in self.settings:
            require_name("the name of a setting", name)
        values = {name: require_number(f"settings.{name}", value, -1e12, 1e12) for name, value in self.settings.items()}
        object.__setattr__(self, "settings", MappingProxyType(values))
        for name in ("made", "expires"):
            require_time(name, getattr(self, name))
        if (self.made is None) != (self.expires is None):
            raise InputError(f"made and expires must be given together; got {self.made} and {self.expires}")
        if self.made is not None and self.expires is not None and self.expires <= self.made:
            raise InputError(f"expires must lie after made; got {self.expires} and {self.made}")

    def _require_one_probe(self) -> None:
        for what in ("response", "tissue", "specification"):
            part = getattr(self, what)
            if part is None:
                continue
            if isinstance(part, Calibration):
                require_name(f"{what}.name", part.name)
            require_name(f"{what}.probe", part.probe)
            if part.probe and self.probe and part.probe != self.probe:
                raise InputError(f"{what}.probe must be that of the calibration, {self.probe!r}; got {part.probe!r}")

    def require_usable(
        self,
        now: datetime,
        *,
        probe: str | None = None,
        camera: str | None = None,
        settings: Mapping[str, float] | None = None,
    ) -> None:
        """Refuse a calibration that is expired, dated in the future, or of another probe, camera or setting.

        Raises `CalibrationError` naming what differs and the cure.

        Parameters
        ----------
        now
            The present time, with its zone.
        probe, camera, settings
            What it will be used with; None is not compared.
        """
        if self.expires is not None and now > self.expires:
            raise CalibrationError(
                f"calibration {self.name!r} must not be expired; it was good until {self.expires:%Y-%m-%d} "
                "(make a new one: tsis calibrate)"
            )
        if self.made is not None and self.made.astimezone(UTC) > now.astimezone(UTC):
            raise CalibrationError(
                f"calibration {self.name!r} must not come from the future; it was made {self.made:%Y-%m-%d %H:%M} "
                "(is this computer's clock right?)"
            )
        self.require_same_instrument(probe=probe, camera=camera, settings=settings)

    def require_same_instrument(
        self,
        *,
        probe: str | None = None,
        camera: str | None = None,
        settings: Mapping[str, float] | None = None,
    ) -> None:
        """Refuse, with `CalibrationError`, another probe, camera or setting; None is not compared."""
        for what, ours, theirs in (("probe", self.probe, probe), ("camera", self.camera, camera)):
            if theirs is not None and ours and theirs and ours != theirs:
                raise CalibrationError(
                    f"calibration {self.name!r} must be of the {what} in use, {theirs!r}; it is of {ours!r} "
                    "(choose its own calibration, or make one: tsis calibrate)"
                )
        present = settings or {}
        for name, value in self.settings.items():
            if name in present and abs(present[name] - value) > SETTING_TOLERANCE * max(abs(value), 1e-9):
                raise CalibrationError(
                    f"calibration {self.name!r} holds at {name} = {value:g}; the camera is at {present[name]:g} "
                    "(set it back, or calibrate at this setting)"
                )

    def need(self, kind: type[Part], purpose: str) -> Part:
        """The part of this type, which ``purpose`` requires; `CalibrationError` when it was not measured."""
        name = next(name for name, part in PARTS.items() if part is kind)
        part = getattr(self, name)
        if not isinstance(part, kind):
            raise CalibrationError(
                f"{purpose} needs the part {name!r}, which calibration {self.name!r} does not hold (tsis calibrate)"
            )
        return part

    def _repr_html_(self) -> str:
        """Probe, camera, dates, and the parts that were measured."""
        rows = [
            ("probe", self.probe or "unknown"),
            ("camera", self.camera or "unknown"),
            ("made", "simulated" if self.made is None else self.made.isoformat()),
            ("expires", "never" if self.expires is None else self.expires.isoformat()),
            ("parts", ", ".join(name for name in PARTS if getattr(self, name) is not None) or "none"),
        ]
        return summary_html(self.name or "Calibration", rows)

    def cited_response(self, identity: str, *, on_tissue: bool = False) -> Calibration:
        """The response, named after the calibration and its hash, for the calibration's probe.

        ``on_tissue`` prefers that on soft objects.
        """
        response = self.need(Calibration, "an estimate")
        if on_tissue and self.tissue is not None:
            response = self.tissue
        name = f"{self.name or response.name} ({identity[:12]})"
        return replace(response, name=name, probe=response.probe or self.probe)


PARTS: Mapping[str, type] = MappingProxyType(
    {
        "scale": PixelScale,
        "reference": CameraReference,
        "force_line": ForceLine,
        "response": Calibration,
        "tissue": Calibration,
        "specification": Specification,
    }
)


CALIBRATION_FORMAT, CALIBRATION_VERSION = "tsis-calibration", 1
LARGEST_BYTES = 128 * 2**20  # maps of a camera of 8 million pixels


def calibration_sha256(calibration: ProbeCalibration) -> str:
    """SHA-256 of the content, by which results cite the calibration."""
    sha256 = document_sha256(to_json_value(calibration, pack=False))
    assert sha256 is not None  # values contain neither NaN nor endless nesting
    return sha256


def calibration_bytes(calibration: ProbeCalibration) -> bytes:
    """Content of the calibration file; `InputError` when it exceeds `LARGEST_BYTES`."""
    content = to_json_value(calibration)
    require_bounded_arrays(content, "calibration")
    document = {
        "format": CALIBRATION_FORMAT,
        "version": CALIBRATION_VERSION,
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "sha256": calibration_sha256(calibration),
        "calibration": content,
    }
    encoded = json_bytes(document)
    if len(encoded) > LARGEST_BYTES:
        raise InputError(
            f"calibration must take at most {LARGEST_BYTES} bytes, so that it can be read back; got {len(encoded)}"
        )
    return encoded


def write_calibration(calibration: ProbeCalibration, path: str | os.PathLike[str]) -> str:
    """Write a new file atomically and return its identity.

    Raises `FileInputError` when the file exists already or cannot be written; `InputError` as `calibration_bytes`.
    """
    target = as_path(path)
    content = calibration_bytes(calibration)
    try:
        if target.exists():
            raise FileInputError(
                f"{printable_path(target)} must be a new file; it exists already (choose another name)"
            )
        target.parent.mkdir(parents=True, exist_ok=True)
        write_durably(target, content)
    except OSError as error:
        reason = error.strerror or error
        raise FileInputError(f"{printable_path(target)} must be a file that can be written; got: {reason}") from error
    return calibration_sha256(calibration)


def read_calibration(path: str | os.PathLike[str]) -> ProbeCalibration:
    """Read a calibration file; `ProbeCalibration.require_usable` checks its use.

    Raises `FileInputError` when it is missing, of another format or version, or a value is out of range;
    `CalibrationError` when its hash does not match: it was changed or damaged.
    """
    source = as_path(path)
    return _parsed(read_object(source, most=LARGEST_BYTES), printable_path(source))


def parse_calibration(content: bytes, name: str) -> ProbeCalibration:
    """Parse the content of a calibration file; ``name`` identifies it in errors.

    Raises `FileInputError` or `CalibrationError` as `read_calibration`.
    """
    if len(content) > LARGEST_BYTES:
        raise FileInputError(f"{name} must be at most {LARGEST_BYTES} bytes; got {len(content)}")
    return _parsed(parse_object(content, name), name)


def _parsed(document: dict[str, Any], name: str) -> ProbeCalibration:
    if document.get("format") != CALIBRATION_FORMAT:
        raise FileInputError(f"{name} must be a file of {CALIBRATION_FORMAT}; got {document.get('format')!r:.60}")
    if document.get("version") != CALIBRATION_VERSION:
        raise FileInputError(
            f"{name} must be of version {CALIBRATION_VERSION}; got {document.get('version')!r:.20} (calibrate again)"
        )
    content = document.get("calibration")
    expected = document_sha256(content)
    if expected is None or document.get("sha256") != expected:
        raise CalibrationError(
            f"{name} must be as it was written; its content does not match its hash, so it was changed or "
            "damaged (take the original, or calibrate again)"
        )
    try:
        require_bounded_arrays(content, "calibration")
        return from_json_value(ProbeCalibration, content, "calibration")
    except InputError as error:
        raise FileInputError(f"{name}: {error}") from error
    except CalibrationError as error:
        raise CalibrationError(f"{name}: {error}") from error


def document_sha256(content: Any) -> str | None:
    """SHA-256 of a calibration's JSON values; None for NaN or endless nesting."""
    try:
        return content_sha256(_as_floats(without_packed_arrays(content)))
    except (ValueError, OverflowError, RecursionError):
        return None


def _as_floats(content: Any) -> Any:
    """Integers as floats: 60 and 60.0 have one hash."""
    if isinstance(content, dict):
        return {name: _as_floats(item) for name, item in content.items()}
    if isinstance(content, list):
        return [_as_floats(item) for item in content]
    return float(content) if type(content) is int else content


LARGEST_VALUES_BYTES = 2**20
BY_HAND = ("response", "scale")  # parts that can be entered by hand
FROM_FRAMES = ("reference", "force_line", "tissue", "specification", "made", "expires")


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
