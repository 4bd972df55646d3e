"""What an image shows without a calibration: its change of grey level, its features, and the round contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.imaging.contact import find_contact
from tsis.imaging.corrections import signal
from tsis.imaging.patch import features

if TYPE_CHECKING:
    from tsis.imaging.contact import Contact
    from tsis.imaging.patch import Features
    from tsis.model.image import TactileImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImageFinding:
    """Analysis of an image: its change of grey level, its features, and the round contact or None."""

    image: TactileImage
    change: TactileImage
    features: Features
    contact: Contact | None


def analyse_image(image: TactileImage, reference: TactileImage | None, *, invert: bool) -> ImageFinding:
    """Analyse an image without a calibration."""
    result = features(image, reference, invert=invert)
    change = signal(image, reference, invert=invert)
    contact = find_contact(change, patch=result.patch) if result.contact else None
    return ImageFinding(image=image, change=change, features=result, contact=contact)
