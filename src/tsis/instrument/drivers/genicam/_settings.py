"""The features of a GenICam camera, as the libraries of Basler and Harvesters offer them.

Each library wraps the same node map in its own classes. `Nodes` is the common part: two kinds of values to read, and
one call to write.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from tsis.errors import CameraError
from tsis.instrument._camera import Setting
from tsis.model.require import require_one_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberNode:
    """A number of a camera; a switch is a number from 0 to 1.

    Parameters
    ----------
    value
        Present value.
    low, high
        The range in the camera's present state, ends included.
    step
        Distance of the valid values, counted from ``low``; 0 where any is valid.
    unit
        The camera's unit, e.g. ``"us"``; empty without one.
    """

    value: float
    low: float = -math.inf
    high: float = math.inf
    step: float = 0.0
    unit: str = ""

    def nearest(self, value: float) -> float:
        """The nearest valid value.

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
    """A choice of a camera, with its present options."""

    value: str
    options: tuple[str, ...]


class Nodes(Protocol):
    """The node map of one open camera."""

    def read(self, name: str) -> NumberNode | ChoiceNode | None:
        """The value of that name; None when it is absent or not readable now."""

    def write(self, name: str, value: float | str) -> None:
        """Write the value; the library's errors when the camera refuses."""


def number_node(nodes: Nodes, name: str) -> NumberNode | None:
    """The number of that name, or None."""
    node = nodes.read(name)
    return node if isinstance(node, NumberNode) else None


def choice_node(nodes: Nodes, name: str) -> ChoiceNode | None:
    """The choice of that name, or None."""
    node = nodes.read(name)
    return node if isinstance(node, ChoiceNode) else None


def first_number(nodes: Nodes, names: Iterable[str]) -> tuple[str, NumberNode] | None:
    """The first of the names with a number: newer names come before older ones."""
    for name in names:
        node = number_node(nodes, name)
        if node is not None:
            return name, node
    return None


def set_choice(nodes: Nodes, name: str, option: str) -> None:
    """Set a choice, where the camera has it, offers that option, and has another value."""
    node = choice_node(nodes, name)
    if node is not None and node.value != option and option in node.options:
        nodes.write(name, option)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Feature:
    """The camera's nodes of a setting, and the nodes that must be off or on for it."""

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
    """The available settings, with their present values and ranges."""
    nodes_of = ((name, first_number(nodes, feature.nodes)) for name, feature in _FEATURES.items())
    return tuple(_setting(name, node[1]) for name, node in nodes_of if node is not None)


def adjust(nodes: Nodes, name: str, value: float) -> None:
    """Change one setting, and switch off its automatic control.

    Raises `UnknownNameError` when the camera has no such setting; `InputError` when the value lies outside its range;
    `CameraError` when the camera has no settings, or refuses.
    """
    present = {setting.name: setting for setting in settings(nodes)}
    if not present:
        raise CameraError(f"the camera has no setting called {name!r}; it has none at all")
    feature = _FEATURES[require_one_of("setting", name, present)]
    if feature.automatic:
        set_choice(nodes, feature.automatic, "Off")
    for switch in feature.switches:
        switch_node = number_node(nodes, switch)
        if switch_node is not None and switch_node.value == 0:
            nodes.write(switch, 1)
    named_node = first_number(nodes, feature.nodes)  # read again: the switches may have changed the range
    if named_node is None:
        raise CameraError(f"the camera no longer reports its {name}")
    node_name, node = named_node
    requested = _setting(name, node).checked(value)
    nodes.write(node_name, node.nearest(requested * feature.scale))


def run_free(nodes: Nodes) -> None:
    """Switch off the trigger and automatic controls: frames follow each other with constant settings."""
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


def _setting(name: str, number_node: NumberNode) -> Setting:
    feature = _FEATURES[name]
    low, high = (end / feature.scale if math.isfinite(end) else end for end in (number_node.low, number_node.high))
    return Setting(
        name=name, value=number_node.value / feature.scale, low=low, high=high, unit=feature.unit or number_node.unit
    )
