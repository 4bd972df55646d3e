"""What a search for cameras says about each one that it found."""

from __future__ import annotations

import importlib
import threading
from collections.abc import Mapping  # noqa: TC003 - read when the dataclass is made
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError
from tsis.model import require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from tsis.instrument._camera import Camera


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraInfo:
    """A camera that answered a search, with what is needed to connect to it.

    Parameters
    ----------
    source
        Name of the source that can reach it, e.g. ``"aravis"``.
    identity
        What that source calls it: a serial number, an address or an index, unique among the source's cameras.
    maker, model
        Who made it and what it is; empty where the source does not tell.
    note
        What else helps to tell it from another, e.g. its address.

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
        """What `tsis.instrument.connect` takes to reach it."""
        return f"{self.source}:{self.identity}"


_HOME = "tsis.instrument.drivers"
# By source: the module with find_cameras_here() and missing_requirement(), and the camera's module and class.
_LIVE = {
    "aravis": ("aravis._search", "aravis._camera", "AravisCamera"),
    "genicam": ("genicam._harvesters", "genicam._harvesters", "HarvestersCamera"),
    "pylon": ("_pylon", "_pylon", "PylonCamera"),
    "vimba": ("_vimba", "_vimba", "VimbaCamera"),
    "opencv": ("_opencv", "_opencv", "OpenCVDevice"),
}
_STORED = {"files": ("_files", "ImageFiles"), "video": ("_video", "VideoFile")}
LIVE_SOURCES, STORED_SOURCES = tuple(_LIVE), tuple(_STORED)
SOURCES = (*LIVE_SOURCES, *STORED_SOURCES)
_TIMEOUT_S = 20.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraListing:
    """What a search found.

    Parameters
    ----------
    cameras
        The cameras that answered, source by source.
    missing
        For each source that could not look, one sentence that says why and what to do.
    """

    cameras: tuple[CameraInfo, ...]
    missing: Mapping[str, str]

    def __post_init__(self) -> None:
        object.__setattr__(self, "missing", MappingProxyType(dict(self.missing)))


def find_cameras(
    sources: Iterable[str] = LIVE_SOURCES,
    *,
    module: Callable[[str], Any] | None = None,
    timeout_s: float = _TIMEOUT_S,
) -> CameraListing:
    """Ask every source for its cameras; one that fails or hangs is named among the missing and stops no other.

    Parameters
    ----------
    sources
        Names of the sources to ask.
    module
        Gives the module of a source by its name; the imported one when None.
    timeout_s
        How long one source may take, in [0.01, 600] s.

    Raises
    ------
    UnknownNameError
        When a source has another name.
    """
    require_number("timeout_s", timeout_s, 0.01, 600.0, hint="seconds")
    names = [require_one_of("camera source", name, LIVE_SOURCES) for name in sources]
    camera_infos: list[CameraInfo] = []
    missing: dict[str, str] = {}
    for name in names:
        response = _ask_source(name, module or _searching_module, timeout_s)
        if isinstance(response, str):
            missing[name] = response
        else:
            camera_infos.extend(response)
    return CameraListing(cameras=tuple(camera_infos), missing=missing)


def connect(spec: str) -> Camera:
    """The camera that ``spec`` names, not yet opened.

    Parameters
    ----------
    spec
        ``"SOURCE:ID"``: aravis, genicam, pylon or vimba with what `find_cameras` calls the camera (nothing after the
        colon for the first found); ``"opencv:0"``; ``"files:PATH"`` or ``"video:PATH"``.

    Raises
    ------
    UnknownNameError
        When there is no such source; the nearest is suggested.
    InputError
        When what follows the colon names nothing.

    Examples
    --------
    >>> connect("files:frames").name
    'frames'
    """
    require_type("spec", spec, str)
    name, _, identity = spec.partition(":")
    require_one_of("camera source", name, SOURCES)
    if name == "opencv":
        if not identity.isdecimal() and identity:
            raise InputError(f"opencv cameras go by their number, as in opencv:0; got {spec!r:.80}")
        return _class(*_LIVE[name][1:])(int(identity or 0))  # type: ignore[no-any-return]
    if name in _LIVE:
        return _class(*_LIVE[name][1:])(identity)  # type: ignore[no-any-return]
    if not identity:
        raise InputError(f"{name}: must be followed by a path, as in {name}:frames; got {spec!r}")
    return _class(*_STORED[name])(identity)  # type: ignore[no-any-return]


def _class(module: str, name: str) -> Any:
    return getattr(importlib.import_module(f"{_HOME}.{module}"), name)


def _searching_module(source: str) -> Any:
    return importlib.import_module(f"{_HOME}.{_LIVE[source][0]}")


def _ask_source(source: str, module: Callable[[str], Any], timeout_s: float) -> tuple[CameraInfo, ...] | str:
    """The cameras of one source, or why it cannot look; asked in a thread, for a driver may never answer."""
    responses: list[tuple[CameraInfo, ...] | str] = []

    def ask() -> None:
        try:
            searching = module(source)
            responses.append(searching.missing_requirement() or tuple(searching.find_cameras_here()))
        except Exception as error:  # a driver may raise anything, and one must not hide the cameras of the others
            responses.append(
                f"the camera source {source} failed: {' '.join(str(error).split()) or type(error).__name__}"
            )

    thread = threading.Thread(target=ask, name=f"search for {source} cameras", daemon=True)
    thread.start()
    thread.join(timeout_s)
    return responses[0] if responses else f"the camera source {source} did not answer within {timeout_s:g} s"
