"""How a guided session begins, or goes on where one was left."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.instrument import printable_path
from tsis.model.errors import CalibrationError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console

    from tsis.calibration.session import SessionFolder, SessionSetup

OPTIONS = {  # by the term that each one states
    "name": "--name",
    "pitch_mm": "--pitch-mm",
    "pitch_sd_mm": "--pitch-sd-mm",
    "gauge_share": "--gauge-share",
    "patch_px": "--patch-px",
    "tips_mm": "--tip-mm",
    "repeats": "--repeats",
}


def begin(folder: SessionFolder, terms: SessionSetup, console: Console) -> None:
    """Begin a session, or go on with the one in the folder.

    Raises
    ------
    CalibrationError
        When it was begun on other terms: what is calculated would be those, whatever the command says now.
    """
    if not folder.begun:
        folder.begin(terms)
        return
    held = folder.terms()
    if (held.probe, held.camera) != (terms.probe, terms.camera):
        raise CalibrationError(
            f"the session in {printable_path(folder.path)} must be of probe {terms.probe!r} and camera {terms.camera!r}; it is "
            f"of {held.probe!r} and {held.camera!r} (choose another --session)"
        )
    if other := held.differing(terms):
        raise CalibrationError(
            f"the session in {printable_path(folder.path)} was begun with {_told(held, other)}; this command says "
            f"{_told(terms, other)} (give the options that it was begun with, or choose another --session)"
        )
    if changed := held.changed_setting(terms.settings):
        setting, value, now = changed
        raise CalibrationError(
            f"the session in {printable_path(folder.path)} was begun at {setting} = {value:g}; the camera is at {now:g} "
            f"(--set {setting}={value:g}, or choose another --session)"
        )
    console.print(f"Going on with the session in {folder.path}; its terms hold.", markup=False, soft_wrap=True)


def _told(terms: SessionSetup, names: Iterable[str]) -> str:
    """Terms as one types them."""
    return " ".join(_typed(OPTIONS[name], getattr(terms, name)) for name in names)


def _typed(option: str, value: object) -> str:
    if value is None:
        return f"no {option}"
    if option == "--patch-px" and isinstance(value, tuple):
        return f"{option} {','.join(map(str, value))}"
    each = value if isinstance(value, tuple) else (value,)
    return " ".join(f"{option} {one!r}" if isinstance(one, str) else f"{option} {one:.12g}" for one in each)
