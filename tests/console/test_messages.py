"""Messages of the console: what is said on a page can be done on a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tsis.console.messages import COMMAND, on_pages
from tsis.hardness.flags import HARDNESS_FLAGS
from tsis.inclusion.flags import INCLUSION_FLAGS
from tsis.mapping.flags import MAP_FLAGS

if TYPE_CHECKING:
    from tsis.model.flag import Flag

FLAGS = (*INCLUSION_FLAGS.values(), *HARDNESS_FLAGS.values(), *MAP_FLAGS.values())


@pytest.mark.parametrize("flag", FLAGS, ids=lambda flag: flag.name)
def test_the_cure_of_a_flag_names_no_command_of_the_terminal(flag: Flag) -> None:
    assert COMMAND.search(on_pages(f"{flag.means}; {flag.cure}")) is None
