"""Which force belongs to which frame of a command line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence


def target_forces(given: Sequence[float], images: int) -> list[float]:
    """Force of each image: one for all, or one an image."""
    return _one_each("--force-n", given, images, "images")


def plain_forces(given: Sequence[float], force_n: Sequence[float], presses: int) -> list[float]:
    """Force of each press on plain tissue: as given; else the force of all images, or of the image in its place."""
    if given:
        return _one_each("--plain-force-n", given, presses, "presses on plain tissue")
    if len(set(force_n)) == 1:
        return [force_n[0]] * presses
    if presses > len(force_n):
        raise InputError(
            "--plain-force-n must tell the force of each --plain when there are more of them than images; "
            f"got {presses} for {len(force_n)} images"
        )
    return list(force_n[:presses])


def _one_each(option: str, given: Sequence[float], count: int, what: str) -> list[float]:
    if len(given) not in (1, count):
        raise InputError(f"{option} must be given once, or once for each of {count} {what}; got it {len(given)} times")
    return list(given) * (count if len(given) == 1 else 1)
