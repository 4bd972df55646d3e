"""What is remembered of a tab, and that it is not remembered for ever."""

from __future__ import annotations

from tsis.console.pages.components import Tabs
from tsis.console.pages.components._summary import KEPT, NAMED
from tsis.console.pages.design._draft import ProbeEditor


def test_names_of_tabs_are_not_given_twice_and_not_kept_for_ever() -> None:
    tabs = Tabs()
    given = [tabs.name(f"tab {number}") for number in range(NAMED + 1)]
    assert len(set(given)) == len(given)
    assert tabs.name(f"tab {NAMED}") == given[-1]
    assert tabs.name("tab 0") not in given


def test_a_tab_finds_its_desk_again_until_many_others_came() -> None:
    tabs = Tabs()
    mine, other = tabs.kept("mine", ProbeEditor), tabs.kept("other", ProbeEditor)
    assert other is not mine
    for number in range(KEPT - 1):
        tabs.kept(f"tab {number}", ProbeEditor)
        assert tabs.kept("mine", ProbeEditor) is mine
    assert tabs.kept("other", ProbeEditor) is not other
    assert Tabs().kept("mine", ProbeEditor) is not mine
