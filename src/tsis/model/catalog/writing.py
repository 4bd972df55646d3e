"""A probe as an entry of a catalog: the same TOML as that of the probes that come with tsis."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from typing import TYPE_CHECKING

from tsis.model.light import Glass, Led

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.model.probe import Probe

_BARE = re.compile(r"[A-Za-z0-9_-]+")
UNNAMED = "probe"


def probe_toml(probe: Probe) -> str:
    """The probe under its name, with all that is not as it is when left out.

    Parameters
    ----------
    probe
        Any probe; one without a name is called ``probe``.

    Examples
    --------
    >>> from tsis import Layer, Probe
    >>> layer = Layer(thickness_mm=10.0, young_kpa=50.0)
    >>> print(probe_toml(Probe(radius_mm=12.0, layers=(layer,), name="soft")), end="")
    [soft]
    radius_mm = 12.0
    layers = [
        { thickness_mm = 10.0, young_kpa = 50.0, poisson = 0.49, refractive_index = 1.41 },
    ]
    leds = [
        { azimuth_deg = 0.0 },
        { azimuth_deg = 90.0 },
        { azimuth_deg = 180.0 },
        { azimuth_deg = 270.0 },
    ]
    """
    name = probe.name or UNNAMED
    lines = [f"[{name if _BARE.fullmatch(name) else _text(name)}]", f"radius_mm = {float(probe.radius_mm)!r}"]
    if probe.face_curvature_mm is not None:
        lines.append(f"face_curvature_mm = {float(probe.face_curvature_mm)!r}")
    if probe.sides != "free":
        lines.append(f"sides = {_text(probe.sides)}")
    lines += ["layers = [", *(f"    {_inline(asdict(layer))}," for layer in probe.layers), "]"]
    if probe.glass != Glass():
        lines.append(f"glass = {_inline(asdict(probe.glass))}")
    lines += ["leds = [", *(f"    {_inline(_changed(led))}," for led in probe.leds), "]"]
    if probe.assumed:
        lines.append(f"assumed = [{', '.join(map(_text, probe.assumed))}]")
    return "\n".join(lines) + "\n"


def _changed(led: Led) -> dict[str, float]:
    """What is not as in any lamp, and always where it stands."""
    usual = asdict(Led())
    return {name: value for name, value in asdict(led).items() if name == "azimuth_deg" or value != usual[name]}


def _inline(values: Mapping[str, float]) -> str:
    return "{ " + ", ".join(f"{name} = {float(value)!r}" for name, value in values.items()) + " }"


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace(
        "\x7f", "\\u007f"
    )  # DEL alone is allowed in JSON and not in TOML
