"""The features of a GenICam camera, as Basler's, Allied Vision's and Harvesters' libraries all offer them.

Each library wraps the same node map in classes of its own. `Nodes` is the little that is needed of it: two kinds of
values to read, one call to write.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from tsis.errors import CameraError
from tsis.instrument._camera import LATE_FRAMES, SILENT_S, Setting
from tsis.model import require_one_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberNode:
    """A number that a camera holds; a switch is a number from 0 to 1.

    Parameters
    ----------
    value
        What it is now.
    low, high
        The range that the camera takes in its present state, ends included.
    step
        Distance of the values that it takes, counted from ``low``; 0 where any will do.
    unit
        As the camera names it, e.g. ``"us"``; empty when it does not.
    """

    value: float
    low: float = -math.inf
    high: float = math.inf
    step: float = 0.0
    unit: str = ""

    def nearest(self, value: float) -> float:
        """The value nearest to ``value`` that the camera takes.

        Examples
        --------
        >>> NumberNode(value=0, low=2, high=10, step=4).nearest(7.9)
        6.0
        >>> NumberNode(value=0, low=2, high=9, step=4).nearest(100)
        6.0
        """
        if self.step <= 0 or not math.isfinite(self.low):
            return float(min(max(value, self.low), self.high))
        last = math.inf if math.isinf(self.high) else math.floor((self.high - self.low) / self.step)
        return float(self.low + min(max(round((value - self.low) / self.step), 0), last) * self.step)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChoiceNode:
    """A word that a camera holds, out of those that it takes now."""

    value: str
    options: tuple[str, ...]


class Nodes(Protocol):
    """The node map of one open camera."""

    def read(self, name: str) -> NumberNode | ChoiceNode | None:
        """What the camera holds under that name; None when there is no such feature or it cannot be read now."""

    def write(self, name: str, value: float | str) -> None:
        """Change it; the errors of its library when the camera refuses."""


def number_node(nodes: Nodes, name: str) -> NumberNode | None:
    """The number of that name, or None."""
    stored = nodes.read(name)
    return stored if isinstance(stored, NumberNode) else None


def choice_node(nodes: Nodes, name: str) -> ChoiceNode | None:
    """The word of that name, or None."""
    stored = nodes.read(name)
    return stored if isinstance(stored, ChoiceNode) else None


def first_number(nodes: Nodes, names: Iterable[str]) -> tuple[str, NumberNode] | None:
    """The first of the names that the camera holds a number under: newer names come before older ones."""
    for name in names:
        stored = number_node(nodes, name)
        if stored is not None:
            return name, stored
    return None


def set_choice(nodes: Nodes, name: str, option: str) -> None:
    """Set a word, where the camera has it, offers that option, and holds another."""
    stored = choice_node(nodes, name)
    if stored is not None and stored.value != option and option in stored.options:
        nodes.write(name, option)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Feature:
    """Where a setting lives in the camera, and what must be off or on before it has an effect."""

    nodes: tuple[str, ...]
    scale: float = 1.0  # of our unit to the camera's
    unit: str = ""  # ours; the camera's own when empty
    automatic: str = ""
    switches: tuple[str, ...] = ()


_FEATURES: Mapping[str, _Feature] = {
    "exposure_ms": _Feature(
        nodes=("ExposureTime", "ExposureTimeAbs"), scale=1000.0, unit="ms", automatic="ExposureAuto"
    ),
    "gain": _Feature(nodes=("Gain", "GainRaw"), automatic="GainAuto"),
    "brightness": _Feature(nodes=("BlackLevel", "BlackLevelRaw"), automatic="BlackLevelAuto"),
    "frames_per_s": _Feature(
        nodes=("AcquisitionFrameRate", "AcquisitionFrameRateAbs"),
        unit="1/s",
        automatic="AcquisitionFrameRateAuto",
        switches=("AcquisitionFrameRateEnable", "AcquisitionFrameRateEnabled"),
    ),
}


def settings(nodes: Nodes) -> tuple[Setting, ...]:
    """Those of the settings that the camera has, with their present values and ranges."""
    result = ((name, first_number(nodes, feature.nodes)) for name, feature in _FEATURES.items())
    return tuple(_setting(name, stored[1]) for name, stored in result if stored is not None)


def adjust(nodes: Nodes, name: str, value: float) -> None:
    """Change one setting, switching off what the camera would do to it by itself.

    Raises
    ------
    UnknownNameError
        When the camera has no such setting.
    InputError
        When the value lies outside its range.
    CameraError
        When the camera has no settings, or refuses.
    """
    present = {setting.name: setting for setting in settings(nodes)}
    if not present:
        raise CameraError(f"the camera has no setting called {name!r}; it has none at all")
    feature = _FEATURES[require_one_of("setting", name, present)]
    if feature.automatic:
        set_choice(nodes, feature.automatic, "Off")
    for switch in feature.switches:
        stored = number_node(nodes, switch)
        if stored is not None and stored.value == 0:
            nodes.write(switch, 1)
    result = first_number(nodes, feature.nodes)  # anew: the switches may have changed the range
    if result is None:
        raise CameraError(f"the camera no longer tells its {name}")
    node, stored = result
    requested = _setting(name, stored).checked(value)
    nodes.write(node, stored.nearest(requested * feature.scale))


def run_free(nodes: Nodes) -> None:
    """Let frames come one after the other, alike: no trigger, and nothing automatic that changes their grey levels."""
    set_choice(nodes, "AcquisitionMode", "Continuous")
    for feature in _FEATURES.values():
        if feature.automatic:
            set_choice(nodes, feature.automatic, "Off")
    selector = choice_node(nodes, "TriggerSelector")
    if selector is None:
        set_choice(nodes, "TriggerMode", "Off")
        return
    for option in selector.options:
        set_choice(nodes, "TriggerSelector", option)
        set_choice(nodes, "TriggerMode", "Off")
    set_choice(nodes, "TriggerSelector", selector.value)


def timeout_s(values: Mapping[str, float]) -> float:
    """How long a running camera may deliver nothing before it counts as lost: 1 s, or three frames if that is longer.

    Examples
    --------
    >>> patience_s({"frames_per_s": 30.0, "exposure_ms": 20.0})
    1.0
    >>> patience_s({"frames_per_s": 0.5})
    6.0
    """
    rate = values.get("frames_per_s", 0.0)
    period_s = 1.0 / rate if rate > 0 else 0.0
    return max(SILENT_S, LATE_FRAMES * max(period_s, values.get("exposure_ms", 0.0) / 1000.0))


def _setting(name: str, number_node: NumberNode) -> Setting:
    feature = _FEATURES[name]
    low, high = (end / feature.scale if math.isfinite(end) else end for end in (number_node.low, number_node.high))
    return Setting(
        name=name, value=number_node.value / feature.scale, low=low, high=high, unit=feature.unit or number_node.unit
    )
