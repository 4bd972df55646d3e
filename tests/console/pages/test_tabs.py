"""Names and saved values of tabs, and their limits."""

from __future__ import annotations

from tsis.console.pages.design import ProbeEditor
from tsis.console.viewer import MOST_NAMES, MOST_VALUES, Tabs


def test_names_of_tabs_are_unique_and_limited() -> None:
    tabs = Tabs()
    names = [tabs.name(f"tab {number}") for number in range(MOST_NAMES + 1)]
    assert len(set(names)) == len(names)
    assert tabs.name(f"tab {MOST_NAMES}") == names[-1]
    assert tabs.name("tab 0") not in names


def test_a_tab_finds_its_editor_again_until_many_others_came() -> None:
    tabs = Tabs()
    mine, other = tabs.saved("mine", ProbeEditor), tabs.saved("other", ProbeEditor)
    assert other is not mine
    for number in range(MOST_VALUES - 1):
        tabs.saved(f"tab {number}", ProbeEditor)
        assert tabs.saved("mine", ProbeEditor) is mine
    assert tabs.saved("other", ProbeEditor) is not other
    assert Tabs().saved("mine", ProbeEditor) is not mine
