"""Declaration of a flag: a named doubt about a result, with its meaning, threshold and cure."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True, kw_only=True)
class Flag:
    """A named doubt about a result, declared once for reports, console and documents.

    Attributes
    ----------
    name
        A stable name.
    means
        What it says of the result, without a full stop.
    cure
        What to do, without a full stop; empty where nothing helps.
    raised
        From which value on it is raised, and where that limit comes from.
    withholds
        Whether the numbers of the result are not to be trusted and are withheld.
    """

    name: str
    means: str
    cure: str = ""
    raised: str = ""
    withholds: bool = False

    @property
    def advice(self) -> str:
        """The cure as a sentence; empty without one."""
        return f"{self.cure[:1].upper()}{self.cure[1:]}." if self.cure else ""


AnyFlag = TypeVar("AnyFlag", bound=Flag)


def declared(*flags: AnyFlag) -> Mapping[str, AnyFlag]:
    """The flags by name, in their order."""
    return MappingProxyType({flag.name: flag for flag in flags})


def withholding(flags: Mapping[str, Flag]) -> frozenset[str]:
    """Names of the flags that withhold numbers."""
    return frozenset(name for name, flag in flags.items() if flag.withholds)
