"""Plug-ins of other packages by entry points.

A package offers a plug-in in its pyproject.toml, for example a camera of the name ``acme``::

    [project.entry-points."tsis.cameras"]
    acme = "acme_tsis:driver"

docs/how-to/write-a-plug-in.md says what each kind must be. A name of tsis itself cannot be replaced. A plug-in that
cannot be loaded is named, and everything else goes on without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import metadata
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError, PluginError

if TYPE_CHECKING:
    from collections.abc import Mapping


PLUGIN_KINDS: Mapping[str, str] = MappingProxyType(  # by the end of the group's name: what the entry point must be
    {
        "cameras": "an object with find_cameras_here(), missing_requirement() and connect(identity)",
        "probes": "a function without arguments that returns a tsis.Probe",
        "gauges": "a function of the text after 'NAME:' that returns a tsis.instrument.gauge.Gauge",
        "matching": "a function as tsis.matching.methods.MatchMethod",
        "exporters": "a function of a tsis.records.values.TargetRecord and the path of a new file, which it writes",
    }
)
_NEEDS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"cameras": ("find_cameras_here", "missing_requirement", "connect")}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plugin:
    """A plug-in that an installed package offers; it is not loaded yet.

    Attributes
    ----------
    kind
        One of `PLUGIN_KINDS`.
    name
        Name by which users choose it.
    package
        The package that brings it, with its version.
    target
        Module and object, as ``"module:object"``.
    """

    kind: str
    name: str
    package: str
    target: str


@cache
def find_plugins(kind: str) -> Mapping[str, Plugin]:
    """The plug-ins of a kind by their names; of two with one name that of the first package in the alphabet.

    Raises
    ------
    InputError
        When there is no such kind.

    Examples
    --------
    >>> sorted(PLUGIN_KINDS)
    ['cameras', 'exporters', 'gauges', 'matching', 'probes']
    >>> find_plugins("lenses")
    Traceback (most recent call last):
    ...
    tsis.errors.InputError: kind of plug-in must be one of cameras, probes, gauges, matching, exporters; got 'lenses'
    """
    if kind not in PLUGIN_KINDS:
        raise InputError(f"kind of plug-in must be one of {', '.join(PLUGIN_KINDS)}; got {kind!r:.80}")
    offered = [_plugin(kind, entry) for entry in metadata.entry_points(group=f"tsis.{kind}")]
    offered.sort(key=lambda plugin: (plugin.name, plugin.package), reverse=True)
    return MappingProxyType({plugin.name: plugin for plugin in offered})


def load_plugin(kind: str, name: str) -> Any:
    """The object of a plug-in that `find_plugins` lists.

    Raises
    ------
    PluginError
        When it cannot be imported or is not what its kind requires; the message names the package.
    """
    plugin = find_plugins(kind)[name]
    module, _, _ = plugin.target.partition(":")
    entry = metadata.EntryPoint(name=name, value=plugin.target, group=f"tsis.{kind}")
    try:
        loaded = entry.load()
    except Exception as error:  # a plug-in may raise anything, and must not stop the program
        reason = " ".join(str(error).split()) or type(error).__name__
        raise PluginError(
            f"the plug-in {name} of {plugin.package} must be importable from {module}; it failed: {reason:.200} "
            f"(update or uninstall that package)"
        ) from error
    lacking = [part for part in _NEEDS.get(kind, ()) if not callable(getattr(loaded, part, None))]
    if lacking or not (kind in _NEEDS or callable(loaded)):
        raise PluginError(
            f"the plug-in {name} of {plugin.package} must be {PLUGIN_KINDS[kind]}; "
            f"got {f'one without {lacking[0]}()' if lacking else type(loaded).__name__}"
        )
    return loaded


def _plugin(kind: str, entry: metadata.EntryPoint) -> Plugin:
    package = f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else "an unnamed package"
    return Plugin(kind=kind, name=entry.name, package=package, target=entry.value)
