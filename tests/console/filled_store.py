"""A store as a laboratory has it after a while, filled before a console is started."""

from __future__ import annotations

from datetime import timedelta
from typing import TYPE_CHECKING

from tests.records.pressed_object import stored_object
from tests.records.sample import WHEN, levels, sample_calibration, sample_record

from tsis.model.image import TactileImage
from tsis.records.store import open_store

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Page

ESTIMATED, MANY, HARD = 3, 4, 5  # numbers of the targets
PRESSES = 30


def fill(folder: Path) -> None:
    """Three targets: one estimated, one of many presses, one whose hardness can be estimated again."""
    with open_store(folder) as store:
        store.import_target(sample_record())
        many = store.add_target(number=MANY, name="many presses", note="a long series\nof two lines")
        for at in range(PRESSES):
            image = TactileImage(
                grey=levels(at, height=0.1 + 0.02 * at).astype(float),
                full_scale=255.0,
                force_n=None if at % 7 == 0 else 0.1 * at,
                mm_per_pixel=(0.12, 0.14),
            )
            store.add_press(
                many,
                image,
                role=("target", "plain", "untouched", "ball")[at % 4],
                taken=WHEN + timedelta(minutes=at),
                probe="tsis-2011",
                calibration=sample_calibration(),
                flags=("moving", "saturated") if at % 9 == 0 else (),
            )
        assert stored_object(store).number == HARD


def still(page: Page) -> None:
    """Wait until nothing moves in a page, as dialogs do while they open."""
    page.wait_for_function("document.getAnimations().every(each => each.effect.getTiming().iterations === Infinity)")
