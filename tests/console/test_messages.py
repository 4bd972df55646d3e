"""Messages of the console: what is said on a page can be done on a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.console.messages import COMMAND, on_pages
from tsis.hardness.flags import HARDNESS_FLAGS
from tsis.imaging.contact import analyse_image
from tsis.inclusion.flags import INCLUSION_FLAGS
from tsis.mapping.flags import MAP_FLAGS
from tsis.model.image import TactileImage
from tsis.present.images import finding_notes

if TYPE_CHECKING:
    from tsis.model.flag import Flag

FLAGS = (*INCLUSION_FLAGS.values(), *HARDNESS_FLAGS.values(), *MAP_FLAGS.values())


@pytest.mark.parametrize("flag", FLAGS, ids=lambda flag: flag.name)
def test_the_cure_of_a_flag_names_no_command_of_the_terminal(flag: Flag) -> None:
    assert COMMAND.search(on_pages(f"{flag.means}; {flag.cure}")) is None


def test_notes_on_own_images_name_no_option_of_the_terminal() -> None:
    image = TactileImage(grey=np.full((40, 60), 9.0), mm_per_pixel=(0.1, 0.1))
    notes = finding_notes(analyse_image(image, image, invert=False))
    assert any("stands out" in note for note in notes)
    assert not any("--" in on_pages(note) for note in notes)
