"""What a console remembers of the tabs of its browsers: a name, and what their pages keep."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any, TypeVar, cast

NAMED = 1000  # tabs; more than anybody opens while a console runs
KEPT = 50  # things that pages keep, whose results may be large
Thing = TypeVar("Thing")


class Tabs:
    """Of each tab the same name, and the same things, when its page is loaded anew; the first ones are forgotten.

    Examples
    --------
    >>> tabs = Tabs()
    >>> tabs.name("tab a"), tabs.name("tab b"), tabs.name("tab a")
    ('browser 1', 'browser 2', 'browser 1')
    """

    def __init__(self) -> None:
        self._names: OrderedDict[str, str] = OrderedDict()
        self._kept: OrderedDict[tuple[str, type[Any]], Any] = OrderedDict()
        self._given = 0

    def name(self, identity: str) -> str:
        """What a browser without a login is called."""
        if identity not in self._names:
            self._given += 1
            self._names[identity] = f"browser {self._given}"
            if len(self._names) > NAMED:
                self._names.popitem(last=False)
        return self._names[identity]

    def kept(self, identity: str, kind: type[Thing]) -> Thing:
        """What a tab keeps of this kind; a new one at first, and when many others were looked for since."""
        found = self._kept.pop((identity, kind), None) or kind()
        self._kept[identity, kind] = found
        if len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return cast("Thing", found)
