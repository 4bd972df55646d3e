"""Values of records: targets, presses, estimates, maps."""

from __future__ import annotations

import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import LARGEST_TARGET
from tsis.errors import CalibrationError, FileInputError, InputError, RecordsError
from tsis.files.canonical_json import SHA256, json_bytes
from tsis.files.json_values import from_json_value, require_bounded_arrays, to_json_value
from tsis.files.reading import parse_object
from tsis.mapping.lump_map import LumpMap, with_finite_numbers, with_infinite_numbers
from tsis.model.content import ContentValue
from tsis.model.estimate import Estimate  # noqa: TC001  # the type of a field, by which JSON is read
from tsis.model.image import TactileImage, require_image_numbers
from tsis.model.phantom import INCLUSION_RANGES
from tsis.model.require import freeze_mappings, require_integer, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from tsis.calibration.file import ProbeCalibration


KINDS = ("phantom", "subject")  # of stores; their data never mix
ROLE_NAMES = {
    "target": "on the target",
    "plain": "reference (no inclusion)",
    "untouched": "not touched",
    "ball": "on a known ball",
}
REFERENCE_ROLES = {"inclusion": "plain", "hardness": "ball"}  # role of the reference presses
ROLES = tuple(ROLE_NAMES)  # of presses; a ball is for hardness
ESTIMATES = ("inclusion", "hardness")
MAP = "map"  # kind of a result beside the estimates
LONGEST_NAME, LONGEST_NOTE = 200, 4000
LARGEST_SIDE_PX = 65_535
LARGEST_VERSION = 2**53
TRUTH_RANGE = (-1e9, 1e9)  # of any name
_ALLOWED_CONTROLS = re.compile(r"[\n\u200c\u200d]")  # line ends, and the joiners of Persian letters and emoji


def require_text(name: str, value: object, longest: int) -> None:
    """Require printable text of at most ``longest`` characters; line ends are allowed."""
    require_type(name, value, str)
    assert isinstance(value, str)
    if len(value) > longest or not _ALLOWED_CONTROLS.sub("", value).isprintable():
        requirement = f"must be printable text of at most {longest} characters"
        raise InputError(name=name, requirement=requirement, value=f"{value!r:.80}")


def require_label(name: str, value: object) -> None:
    """Require a printable label on one line."""
    if not isinstance(value, str) or not 0 < len(value) <= LONGEST_NAME or not value.isprintable() or value.isspace():
        requirement = f"must be 1 to {LONGEST_NAME} printable characters"
        raise InputError(name=name, requirement=requirement, value=f"{value!r:.80}")


def require_moment(name: str, value: object) -> None:
    """Require a time with a time zone that can be converted to UTC."""
    require_type(name, value, datetime)
    assert isinstance(value, datetime)
    if value.tzinfo is None:
        raise InputError(f"{name} must have a time zone; got {value.isoformat()}")
    try:
        value.astimezone(UTC)
    except OverflowError as error:
        raise InputError(f"{name} must be a time that UTC has as well; got {value.isoformat()}") from error


@dataclass(frozen=True, slots=True, kw_only=True)
class Target(ContentValue):
    """A site that was pressed: a phantom, an object, a site on a subject.

    Parameters
    ----------
    number
        Number in its store, in [1, 99999]; unique.
    kind
        ``"phantom"`` or ``"subject"``, as its store.
    name
        A label; of a subject a pseudonym, never a name.
    note
        Free text.
    truth
        True values of a phantom by name with unit, e.g. ``diameter_mm``; empty where unknown.
    made
        Time of entry, with time zone.
    id
        Permanent identity, valid in any store; empty before it is stored.
    version
        Number of edits plus 1.
    """

    number: int
    kind: str
    name: str = ""
    note: str = ""
    truth: Mapping[str, float] = field(default_factory=dict)
    made: datetime
    id: str = ""
    version: int = 1

    def __post_init__(self) -> None:
        require_integer("number", self.number, 1, LARGEST_TARGET, hint="number of the target")
        require_one_of("kind", self.kind, KINDS)
        require_text("name", self.name, LONGEST_NAME)
        if "\n" in self.name:
            value = f"{self.name!r:.80}"
            raise InputError(name="name", requirement="must be one line", value=value, hint="a note may have several")
        require_text("note", self.note, LONGEST_NOTE)
        require_moment("made", self.made)
        require_integer("version", self.version, 1, LARGEST_VERSION)
        require_type("truth", self.truth, Mapping)
        if self.truth and self.kind == "subject":
            raise InputError(f"truth must be empty for a subject, of whom nothing is known; got {dict(self.truth)}")
        for name in self.truth:
            require_label("a name in truth", name)
        truth = {
            name: require_number(f"truth[{name!r}]", value, *INCLUSION_RANGES.get(name, TRUTH_RANGE))
            for name, value in self.truth.items()
        }
        object.__setattr__(self, "truth", MappingProxyType(truth))


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredPress(ContentValue):
    """A frame of the probe with its metadata.

    Parameters
    ----------
    role
        ``"target"``, ``"plain"`` (reference press on tissue without inclusion), ``"untouched"`` or ``"ball"`` (of known
        radius).
    taken
        Time of the frame, with time zone.
    frame
        SHA-256 of the stored image file.
    rows, columns
        Size of the frame in pixels.
    full_scale
        Grey level at which the camera clips.
    force_n
        Force in newtons; None where not measured.
    mm_per_pixel
        Size (x, y) of a pixel on the face in mm; None where not measured.
    axis_px
        Position (x, y) of the probe's axis in the image in pixels.
    probe
        Name of the probe; empty where unknown.
    calibration
        SHA-256 of the active calibration; None without one.
    flags
        Flags of the press guard.
    settings
        Camera settings and the source of the file.
    name
        Name of the frame in reports.
    note
        Free text.
    id, target
        Identities of the press and of its target; empty before it is stored.
    version
        Number of edits plus 1.
    """

    role: str
    taken: datetime
    frame: str
    rows: int
    columns: int
    full_scale: float
    force_n: float | None = None
    mm_per_pixel: tuple[float, float] | None = None
    axis_px: tuple[float, float]
    probe: str = ""
    calibration: str | None = None
    flags: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""
    note: str = ""
    id: str = ""
    target: str = ""
    version: int = 1

    def __post_init__(self) -> None:
        require_one_of("role", self.role, ROLES)
        require_moment("taken", self.taken)
        require_integer("version", self.version, 1, LARGEST_VERSION)
        if not isinstance(self.frame, str) or not SHA256.fullmatch(self.frame):
            raise InputError(f"frame must be the SHA-256 of a stored file; got {self.frame!r:.80}")
        for name in ("rows", "columns"):
            require_integer(name, getattr(self, name), 1, LARGEST_SIDE_PX, hint="pixels")
        require_image_numbers(
            full_scale=self.full_scale, mm_per_pixel=self.mm_per_pixel, force_n=self.force_n, axis_px=self.axis_px
        )
        for name in ("name", "probe"):
            require_text(name, getattr(self, name), LONGEST_NAME)
        require_text("note", self.note, LONGEST_NOTE)
        require_type("flags", self.flags, tuple)
        for flag in self.flags:
            require_text("flag", flag, LONGEST_NAME)
        freeze_mappings(self, "settings")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredEstimate:
    """An estimate with everything needed to repeat it.

    Parameters
    ----------
    kind
        ``"inclusion"`` or ``"hardness"``.
    estimate
        The estimate with its samples.
    made
        Time of the estimate, with time zone.
    probe
        Name of the probe in the catalog.
    presses
        Identities of the presses, in the order of the call.
    calibration
        SHA-256 of the stored calibration.
    options
        Arguments of the call by name as JSON values, e.g. the fields of the prior.
    environment
        Versions of this program and its libraries, and the SHA-256 of its code.
    supersedes
        Identity of the estimate that this one recomputes, or None.
    id, target
        Identities of the estimate and of its target; empty before it is stored.
    """

    kind: str
    estimate: Estimate
    made: datetime
    probe: str
    presses: tuple[str, ...]
    calibration: str
    options: Mapping[str, Any] = field(default_factory=dict)
    environment: Mapping[str, Any] = field(default_factory=dict)
    supersedes: str | None = None
    id: str = ""
    target: str = ""

    def __post_init__(self) -> None:
        require_one_of("kind of estimate", self.kind, ESTIMATES)
        require_text("probe", self.probe, LONGEST_NAME)
        require_moment("made", self.made)
        _freeze_circumstances(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredMap:
    """A map of lumps with everything needed to repeat it.

    Parameters
    ----------
    estimate
        The map with its volumes, and the samples of its lumps.
    presses
        Identities of the presses, in the order of the scan.
    options
        Arguments of `tsis.mapping.estimate_map` by name as JSON values, the prior as its fields; and ``left_out`` of
        the scan.
    made, probe, calibration, environment, supersedes, id, target
        As in `StoredEstimate`; ``supersedes`` is a map.
    """

    estimate: LumpMap
    made: datetime
    probe: str
    presses: tuple[str, ...]
    calibration: str
    options: Mapping[str, Any] = field(default_factory=dict)
    environment: Mapping[str, Any] = field(default_factory=dict)
    supersedes: str | None = None
    id: str = ""
    target: str = ""

    def __post_init__(self) -> None:
        require_text("probe", self.probe, LONGEST_NAME)
        require_moment("made", self.made)
        _freeze_circumstances(self)

    @property
    def kind(self) -> str:
        """``"map"``."""
        return MAP


def _freeze_circumstances(stored: StoredEstimate | StoredMap) -> None:
    for name, part in (("options", "prior"), ("environment", "libraries")):
        known = getattr(stored, name).get(part)
        if known is not None and not isinstance(known, Mapping):
            raise InputError(f"{name}[{part!r}] must be a mapping of names to values; got {known!r:.80}")
    freeze_mappings(stored, "options", "environment")


LARGEST_FORCE_N = 100.0


def parse_truth(lines: Iterable[str], *, called: str = "truth") -> dict[str, float]:
    """True values of a phantom, each written as ``diameter_mm=10``.

    Raises
    ------
    InputError
        When a line is no name with a number, a name comes twice, or the unit of a name of an inclusion is missing; the
        message calls it ``called``.

    Examples
    --------
    >>> parse_truth(["diameter_mm=10", "depth_mm = 4.5"])
    {'diameter_mm': 10.0, 'depth_mm': 4.5}
    """
    truth: dict[str, float] = {}
    for line in lines:
        name, _, text = line.partition("=")
        name = name.strip()
        try:
            value = float(text)
        except ValueError as error:
            requirement = "must be a name and a number as diameter_mm=10"
            raise InputError(name=called, requirement=requirement, value=f"{line!r:.60}") from error
        for known in INCLUSION_RANGES:
            if known.startswith(f"{name}_"):
                raise InputError(
                    f"{called} must name the value with its unit; got {line!r:.60} (write {known}={value:g})"
                )
        if name in truth:
            raise InputError(f"{called} must give each name once; got {name!r:.60} twice (leave one out)")
        truth[name] = value
    return truth


def parse_force(text: str, *, called: str = "force_n", nothing: str = "none") -> float | None:
    """A force in newtons in [0, 100]; None, for an unknown force, where the text equals ``nothing``.

    Raises
    ------
    InputError
        For any other text.

    Examples
    --------
    >>> parse_force("0.72"), parse_force("none")
    (0.72, None)
    """
    if text == nothing:
        return None
    try:
        value = float(text)
    except ValueError as error:
        instead = nothing or "nothing"
        requirement = f"must be a number of newtons, or {instead}"
        raise InputError(name=called, requirement=requirement, value=f"{text!r:.40}") from error
    return require_number(called, value, 0.0, LARGEST_FORCE_N)


def estimate_to_json(stored: StoredEstimate) -> dict[str, Any]:
    """JSON values of a stored estimate without its samples, which `samples_bytes` writes.

    Raises
    ------
    InputError
        When its options, environment or provenance have no JSON form.
    """
    estimate = stored.estimate
    prior_sd = {name: float(sd) for name, sd in estimate.prior_sd.items()}
    document = {"prior_sd": prior_sd} | to_json_value(estimate, without=("untrusted",))
    return to_json_value(stored, without=("estimate",)) | {"estimate": document}


def estimate_from_json(
    document: Any, samples: Mapping[str, NDArray[np.float64]], where: str = "estimate"
) -> StoredEstimate:
    """The stored estimate that `estimate_to_json` wrote, with its samples: name -> shape (n,).

    `InputError` when ``document`` is no estimate or does not fit the samples; ``where`` names it in the message.
    """
    if isinstance(document, dict) and isinstance(result := document.get("estimate"), dict):
        if "samples" in result:
            raise InputError(f"{where}.estimate must hold no samples, which have a file of their own")
        posterior = {"samples": dict(samples), "prior_sd": result.get("prior_sd")}
        others = {name: value for name, value in result.items() if name != "prior_sd"}
        document = document | {"estimate": others | {"untrusted": posterior}}
    return from_json_value(StoredEstimate, document, where, complete=True)


def map_to_json(stored: StoredMap) -> dict[str, Any]:
    """JSON values of a stored map without the map itself, which `map_bytes` writes; errors as `estimate_to_json`."""
    return to_json_value(stored, without=("estimate",))


def map_bytes(found: LumpMap) -> bytes:
    """The file of a map: JSON with its volumes and samples, exact to the last bit."""
    content = to_json_value(with_finite_numbers(found))
    require_bounded_arrays(content, "a map")
    return json_bytes(content)


def map_from_json(document: Any, content: bytes, where: str = "map") -> StoredMap:
    """The stored map that `map_to_json` wrote, with the content of its file; ``where`` names it in errors.

    Raises
    ------
    InputError
        When ``document`` or the file is not what was written.
    """
    found = parse_object(content, where)
    require_bounded_arrays(found, where)
    if not isinstance(document, dict) or "estimate" in document:
        raise InputError(f"{where} must hold what is known of a map, and the map in a file of its own; it does not")
    try:
        stored = from_json_value(StoredMap, document | {"estimate": found}, where, complete=True)
    except CalibrationError as error:  # of a packed array
        raise FileInputError(str(error)) from error
    return replace(stored, estimate=with_infinite_numbers(stored.estimate))


def active_estimates(estimates: Iterable[StoredEstimate]) -> tuple[StoredEstimate, ...]:
    """The active estimates of a target: the last of each kind. ``estimates`` are in the order of time."""
    last = {stored.kind: stored for stored in estimates}
    return tuple(last[kind] for kind in ESTIMATES if kind in last)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetRecord:
    """A target with its presses, estimates, maps and calibrations.

    Parameters
    ----------
    target
        The target.
    presses
        Its presses in the order of time.
    estimates
        Its estimates in the order of time; the last of each kind is active.
    maps
        Its maps of lumps in the order of time; the last is active.
    calibrations
        Calibrations that presses, estimates and maps cite, by SHA-256.
    read
        Reads and checks the grey levels of a stored frame: its SHA-256 -> shape (rows, columns), uint8 or uint16.
    damaged
        A message for each estimate, map and calibration that is omitted because its file is damaged.
    secret
        64 hexadecimal digits from which the pseudonym of the target follows (`tsis.records.deidentification`); no
        export contains them. A store derives them from its own secret, so they never change. A record without a store,
        e.g. from a bundle, has random ones: its pseudonym changes with each reading.
    """

    target: Target
    presses: tuple[StoredPress, ...]
    read: Callable[[str], NDArray[Any]]
    estimates: tuple[StoredEstimate, ...] = ()
    maps: tuple[StoredMap, ...] = ()
    calibrations: Mapping[str, ProbeCalibration] = field(default_factory=dict)
    damaged: tuple[str, ...] = ()
    secret: str = field(default_factory=lambda: secrets.token_hex(32), repr=False)

    def __post_init__(self) -> None:
        freeze_mappings(self, "calibrations")

    @property
    def estimate(self) -> StoredEstimate | None:
        """The last of all estimates."""
        return self.estimates[-1] if self.estimates else None

    @property
    def active_estimates(self) -> tuple[StoredEstimate, ...]:
        """The active estimates: the last of each kind, in the order of `tsis.records.values.ESTIMATES`."""
        return active_estimates(self.estimates)

    @property
    def map(self) -> StoredMap | None:
        """The active map: the last."""
        return self.maps[-1] if self.maps else None

    @property
    def results(self) -> tuple[StoredEstimate | StoredMap, ...]:
        """All estimates, then all maps, each in the order of time."""
        return (*self.estimates, *self.maps)

    @property
    def active_results(self) -> tuple[StoredEstimate | StoredMap, ...]:
        """The active estimates, and the active map."""
        return (*self.active_estimates, *self.maps[-1:])

    def require_whole(self) -> None:
        """Raise `RecordsError` when a part is damaged."""
        if self.damaged:
            raise RecordsError(self.damaged[0])

    def press(self, identity: str) -> StoredPress:
        """The press of that identity, or KeyError."""
        return {press.id: press for press in self.presses}[identity]

    def levels(self, press: StoredPress) -> NDArray[Any]:
        """Grey levels as the camera gave them, shape (rows, columns), uint8 or uint16.

        `RecordsError` when size or type of the stored frame do not match the press.
        """
        levels = self.read(press.frame)
        if levels.shape != (press.rows, press.columns) or levels.dtype not in (np.uint8, np.uint16):
            raise RecordsError(
                f"frame {press.frame:.12} must hold {press.rows} x {press.columns} grey levels of 8 or 16 bits, as its "
                f"press says; got shape {levels.shape} of {levels.dtype}"
            )
        return levels

    def image(self, press: StoredPress) -> TactileImage:
        """The frame as an image for estimates."""
        return TactileImage(
            grey=self.levels(press).astype(np.float64),
            mm_per_pixel=press.mm_per_pixel,
            full_scale=press.full_scale,
            force_n=press.force_n,
            axis_px=press.axis_px,
            name=press.name,
            settings=press.settings,
        )
