"""Two ways back to a known state of the settings: as the camera came, and as low as it goes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tsis.model.check import require_one_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from tsis.instrument.camera import Setting

PRESETS = ("default", "minimal")
# Those of the source's panel (brightness, gain, shutter), as cameras name them.
_OF_LIGHT = frozenset({"brightness", "gain", "gain_db", "exposure", "exposure_ms"})


def preset(name: str, settings: Iterable[Setting]) -> dict[str, float]:
    """Values of the settings that a preset changes, by name.

    Parameters
    ----------
    name
        ``"default"``: the values that ``settings`` hold. ``"minimal"``: the lowest brightness, gain and exposure that
        the camera takes, where its driver tells.
    settings
        The camera's settings as it came, just opened.

    Raises
    ------
    UnknownNameError
        When there is no such preset.

    Examples
    --------
    >>> from tsis.instrument import Setting
    >>> settings = [Setting(name="exposure_ms", value=20.0, low=0.1, high=33.0, unit="ms")]
    >>> preset("minimal", settings), preset("default", settings)
    ({'exposure_ms': 0.1}, {'exposure_ms': 20.0})
    """
    minimal = require_one_of("preset", name, PRESETS) == "minimal"
    light = [setting for setting in settings if setting.name in _OF_LIGHT]
    if not minimal:
        return {setting.name: setting.value for setting in light}
    return {setting.name: setting.low for setting in light if math.isfinite(setting.low)}
