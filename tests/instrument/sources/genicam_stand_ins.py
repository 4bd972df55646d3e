"""A camera's features and its stream, without any library: they refuse what a real camera refuses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.instrument.drivers.genicam import ChoiceNode, Grab, NumberNode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


class DriverError(Exception):
    """What the stand-in's driver raises."""


class FakeNodes:
    """A sensor of 1024 x 768 pixels; sizes in steps of 16 and 2, exposure in microseconds, a GigE camera's ways."""

    def __init__(self, **changes: Any) -> None:
        self.values: dict[str, Any] = {
            "PixelFormat": "RGB8",
            "Width": 512,
            "Height": 384,
            "OffsetX": 100,
            "OffsetY": 0,
            "ExposureTime": 20_000.0,
            "ExposureAuto": "Continuous",
            "Gain": 3.0,
            "BlackLevelRaw": 10,
            "AcquisitionFrameRateEnable": False,
            "AcquisitionFrameRate": 30.0,
            "AcquisitionMode": "SingleFrame",
            "TriggerSelector": "FrameStart",
        } | changes
        self.trigger = {"AcquisitionStart": "Off", "FrameStart": "On", "LineStart": "On"}
        self.options = {
            "PixelFormat": ("RGB8", "Mono12", "Mono8", "Mono12Packed"),
            "ExposureAuto": ("Off", "Once", "Continuous"),
            "AcquisitionMode": ("SingleFrame", "Continuous"),
            "TriggerSelector": tuple(self.trigger),
            "TriggerMode": ("Off", "On"),
        }
        self.writes: list[str] = []

    def read(self, name: str) -> NumberNode | ChoiceNode | None:
        if name in ("WidthMax", "HeightMax"):
            return NumberNode(value={"WidthMax": 1024, "HeightMax": 768}[name])
        if name == "TriggerMode":
            return ChoiceNode(value=self.trigger[self.values["TriggerSelector"]], options=self.options[name])
        if name not in self.values:
            return None
        value = self.values[name]
        if isinstance(value, str):
            return ChoiceNode(value=value, options=self.options[name])
        low, high, step, unit = self._range(name)
        return NumberNode(value=float(value), low=low, high=high, step=step, unit=unit)

    def write(self, name: str, value: float | str) -> None:
        self.writes.append(name)
        if name == "ExposureTime" and self.values.get("ExposureAuto", "Off") != "Off":
            raise DriverError("Node is not writable. : AccessException (file 'x.h', line 7)")
        if name == "AcquisitionFrameRate" and not self.values["AcquisitionFrameRateEnable"]:
            raise DriverError("Node is not writable.")
        if isinstance(value, str):
            if value not in self.options[name]:
                raise DriverError(f"{value} is none of {name}")
        else:
            low, high, step, _ = self._range(name)
            if not low <= value <= high or (step and (value - low) % step):
                raise DriverError(f"Value {value} must lie in {low}..{high} by {step}.")
        if name == "TriggerMode":
            self.trigger[self.values["TriggerSelector"]] = str(value)
        else:
            self.values[name] = value

    def _range(self, name: str) -> tuple[float, float, float, str]:
        return {
            "Width": (16.0, 1024.0 - self.values["OffsetX"], 16.0, ""),
            "Height": (2.0, 768.0 - self.values["OffsetY"], 2.0, ""),
            "OffsetX": (0.0, 1024.0 - self.values.get("Width", 0), 4.0, ""),
            "OffsetY": (0.0, 768.0 - self.values.get("Height", 0), 2.0, ""),
            "ExposureTime": (10.0, 1e6, 0.0, "us"),
            "Gain": (0.0, 24.0, 0.0, "dB"),
            "BlackLevelRaw": (0.0, 63.0, 3.0, ""),
            "AcquisitionFrameRateEnable": (0.0, 1.0, 1.0, ""),
            "AcquisitionFrameRate": (1.0, 60.0, 0.0, "Hz"),
        }[name]


class Clock:
    """Seconds that pass when somebody waits."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


class FakeLink:
    """Plays ``script``: what `grab` returns, an error to raise, or a call to make; silence when it ends."""

    errors: tuple[type[Exception], ...] = (DriverError,)

    def __init__(self, script: Iterable[Any] = (), *, clock: Clock | None = None, identity: str = "K1") -> None:
        self.identity, self.present, self.nodes = identity, True, FakeNodes()
        self.script, self.clock = list(script), clock or Clock()
        self.calls: list[str] = []

    def begin(self) -> None:
        self.calls.append("begin")

    def grab(self, timeout_s: float) -> Grab | None:
        step = self.script.pop(0) if self.script else None
        if step is None:
            self.clock.now_s += timeout_s
        if isinstance(step, Exception):
            raise step
        if callable(step):
            step()
            return None
        return step

    def end(self) -> None:
        self.calls.append("end")

    def close(self) -> None:
        self.calls.append("close")


def whole(number: int | None, time_s: float | None = None) -> Grab:
    """A buffer whose pixels tell its number."""
    return Grab(pixels=np.full((4, 6), (number or 0) % 251, np.uint8), number=number, time_s=time_s)


def torn(number: int | None = None) -> Grab:
    """A buffer that came incomplete."""
    return Grab(pixels=None, number=number)


def links(*made: FakeLink) -> Callable[[], FakeLink]:
    """Gives these links, one an opening."""
    left = list(made)
    return lambda: left.pop(0)
