"""Memory of a server that runs for days."""

from __future__ import annotations

import gc
import threading
import weakref

from tests.waiting import until

from tsis.console.worker import collecting_garbage, share_memory_among_threads


class Knot:
    """Two such things that hold each other are garbage that only a search finds."""

    other: Knot


def test_what_holds_each_other_is_found_while_nothing_else_is_made() -> None:
    gc.disable()
    try:
        with collecting_garbage(every_s=0.01):
            one, two = Knot(), Knot()
            one.other, two.other = two, one
            left = weakref.ref(one)
            del one, two
            until(lambda: left() is None)
            assert gc.get_freeze_count() > 0
        assert gc.get_freeze_count() == 0
        assert not [thread for thread in threading.enumerate() if thread.name == "garbage"]
    finally:
        gc.enable()


def test_memory_is_shared_wherever_that_can_be_asked_for() -> None:
    share_memory_among_threads()
    share_memory_among_threads()  # as often as one likes
