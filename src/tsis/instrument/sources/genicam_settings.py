"""What can be set on a GenICam camera: exposure, gain, brightness and rate, under the names that tsis gives them.

Names and units are those of the Standard Features Naming Convention of the GenICam standard; those ending in ``Abs``
and ``Raw`` are what older GigE cameras call the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.instrument.camera import Setting
from tsis.instrument.patience import LATE_FRAMES, SILENT_S
from tsis.instrument.sources.genicam_nodes import choice_node, first_number, number_node, set_choice
from tsis.model.check import require_one_of
from tsis.model.errors import CameraError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.instrument.sources.genicam_nodes import Nodes, NumberNode


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
    found = ((name, first_number(nodes, feature.nodes)) for name, feature in _FEATURES.items())
    return tuple(_setting(name, held[1]) for name, held in found if held is not None)


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
        held = number_node(nodes, switch)
        if held is not None and held.value == 0:
            nodes.write(switch, 1)
    found = first_number(nodes, feature.nodes)  # anew: the switches may have changed the range
    if found is None:
        raise CameraError(f"the camera no longer tells its {name}")
    node, held = found
    wanted = _setting(name, held).checked(value)
    nodes.write(node, held.nearest(wanted * feature.scale))


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


def patience_s(values: Mapping[str, float]) -> float:
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


def _setting(name: str, held: NumberNode) -> Setting:
    feature = _FEATURES[name]
    low, high = (end / feature.scale if math.isfinite(end) else end for end in (held.low, held.high))
    return Setting(name=name, value=held.value / feature.scale, low=low, high=high, unit=feature.unit or held.unit)
