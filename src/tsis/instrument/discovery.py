"""Search for cameras, and connection to one of them."""

from __future__ import annotations

import importlib
import threading
from collections.abc import Mapping  # noqa: TC003 - read when the dataclass is made
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError, MissingExtraError
from tsis.model.content import ContentValue
from tsis.model.require import require_number, require_one_of, require_type
from tsis.plugins import find_plugins, load_plugin

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from tsis.instrument.camera import Camera


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraInfo:
    """A camera that answered a search.

    Parameters
    ----------
    source
        Name of its source, e.g. ``"aravis"``.
    identity
        Its name in that source: a serial number, an address or an index, unique among the source's cameras.
    maker, model
        Maker and model; empty where unknown.
    note
        Further identification, e.g. its address.

    Examples
    --------
    >>> CameraInfo(source="pylon", identity="0815-0000", maker="Basler", model="Emulation").spec
    'pylon:0815-0000'
    """

    source: str
    identity: str
    maker: str = ""
    model: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        for name in ("source", "identity", "maker", "model", "note"):
            require_type(name, getattr(self, name), str)

    @property
    def spec(self) -> str:
        """Argument of `tsis.instrument.discovery.connect` for this camera."""
        return f"{self.source}:{self.identity}"


def missing_message(load: Callable[[], object]) -> str | None:
    """Message of the library that ``load`` cannot import, with its cure; None when it is installed."""
    try:
        load()
    except MissingExtraError as error:
        return str(error)
    return None


_HOME = "tsis.instrument.drivers"
# By source: the module, which has find_cameras_here() and missing_requirement(), and its camera.
_LIVE = {
    "aravis": ("aravis", "AravisCamera"),
    "genicam": ("harvesters", "HarvestersCamera"),
    "pylon": ("pylon", "PylonCamera"),
    "opencv": ("opencv", "OpenCVDevice"),
}
_STORED = {"files": ("files", "ImageFiles"), "video": ("files", "VideoFile")}
LIVE_SOURCES, STORED_SOURCES = tuple(_LIVE), tuple(_STORED)
SOURCES = (*LIVE_SOURCES, *STORED_SOURCES)
_PLUGINS = "cameras"
_TIMEOUT_S = 20.0


def live_sources() -> tuple[str, ...]:
    """Names of the sources that can be searched for cameras: those of tsis, then those of plug-ins."""
    return (*LIVE_SOURCES, *sorted(set(find_plugins(_PLUGINS)) - set(SOURCES)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraListing(ContentValue):
    """Results of a search.

    Parameters
    ----------
    cameras
        The cameras that answered, source by source.
    missing
        For each source that cannot search, a message with the reason and the cure.
    """

    cameras: tuple[CameraInfo, ...]
    missing: Mapping[str, str]

    def __post_init__(self) -> None:
        object.__setattr__(self, "missing", MappingProxyType(dict(self.missing)))


def find_cameras(
    sources: Iterable[str] | None = None,
    *,
    module: Callable[[str], Any] | None = None,
    timeout_s: float = _TIMEOUT_S,
) -> CameraListing:
    """Search every source for cameras; a source that fails or hangs is reported and stops no other.

    Raises `UnknownNameError` when a source has another name.

    Parameters
    ----------
    sources
        Names of the sources; all of `live_sources` when None.
    module
        Returns the module of a source; the imported one, or a plug-in, when None.
    timeout_s
        Time limit of one source, in [0.01, 600] s.
    """
    require_number("timeout_s", timeout_s, 0.01, 600.0, hint="seconds")
    live = live_sources()
    names = [require_one_of("camera source", name, live) for name in (live if sources is None else sources)]
    camera_infos: list[CameraInfo] = []
    missing: dict[str, str] = {}
    for name in names:
        outcome = _search_source(name, module or _searching_module, timeout_s)
        if isinstance(outcome, str):
            missing[name] = outcome
        else:
            camera_infos.extend(outcome)
    return CameraListing(cameras=tuple(camera_infos), missing=missing)


def connect(spec: str) -> Camera:
    """The camera of ``spec``, not yet opened.

    Parameters
    ----------
    spec
        ``"SOURCE:ID"``: aravis, genicam, pylon or a plug-in with the identity from `find_cameras` (nothing after
        the colon for the first camera); ``"opencv:0"``; ``"files:PATH"`` or ``"video:PATH"``.

    Raises
    ------
    UnknownNameError
        When there is no such source; the message suggests the nearest.
    InputError
        When the identity or path is missing or invalid.
    PluginError
        When the source is a plug-in that cannot be loaded.

    Examples
    --------
    >>> connect("files:frames").name
    'frames'
    """
    require_type("spec", spec, str)
    name, _, identity = spec.partition(":")
    require_one_of("camera source", name, (*live_sources(), *STORED_SOURCES))
    if name == "opencv" and identity and not identity.isdecimal():
        raise InputError(f"opencv cameras go by their number, as in opencv:0; got {spec!r:.80}")
    if name in _STORED and not identity:
        raise InputError(f"{name}: must be followed by a path, as in {name}:frames; got {spec!r}")
    if name not in SOURCES:
        return load_plugin(_PLUGINS, name).connect(identity)  # type: ignore[no-any-return]
    module, camera = _LIVE[name] if name in _LIVE else _STORED[name]
    driver = getattr(importlib.import_module(f"{_HOME}.{module}"), camera)
    return driver(int(identity or 0) if name == "opencv" else identity)  # type: ignore[no-any-return]


def _searching_module(source: str) -> Any:
    if source not in _LIVE:
        return load_plugin(_PLUGINS, source)
    return importlib.import_module(f"{_HOME}.{_LIVE[source][0]}")


def _search_source(source: str, module: Callable[[str], Any], timeout_s: float) -> tuple[CameraInfo, ...] | str:
    """The cameras of one source, or why the search fails; in a thread, because a driver may never return."""
    outcomes: list[tuple[CameraInfo, ...] | str] = []

    def run() -> None:
        try:
            searching = module(source)
            outcomes.append(searching.missing_requirement() or tuple(searching.find_cameras_here()))
        except Exception as error:  # a driver may raise anything and must not hide the cameras of the others
            outcomes.append(
                f"the camera source {source} failed: {' '.join(str(error).split()) or type(error).__name__}"
            )

    thread = threading.Thread(target=run, name=f"search for {source} cameras", daemon=True)
    thread.start()
    thread.join(timeout_s)
    return outcomes[0] if outcomes else f"the camera source {source} did not answer within {timeout_s:g} s"
