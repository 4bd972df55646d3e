"""Declaration of a flag: a named doubt about a result, with its meaning, threshold and cure."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Mapping

Finding = tuple[str, str]  # name of a flag, and its sentence on one result


@dataclass(frozen=True, slots=True, kw_only=True)
class Flag:
    """A named doubt about a result, declared once for estimators, reports, console and documents.

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
    says
        The sentence on one result, with the result's numbers in braces, as in `str.format`; ``{cure}`` and ``{advice}``
        are those of the flag.
    """

    name: str
    means: str
    cure: str = ""
    raised: str = ""
    withholds: bool = False
    says: str = ""

    @property
    def advice(self) -> str:
        """The cure as a sentence; empty without one."""
        return f"{self.cure[:1].upper()}{self.cure[1:]}." if self.cure else ""

    def finding(self, **numbers: float | str) -> Finding:
        """Raise the flag on a result: its name, and its sentence with the ``numbers`` of this result."""
        return self.name, self.says.format(cure=self.cure, advice=self.advice, **numbers)


AnyFlag = TypeVar("AnyFlag", bound=Flag)


def declared(*flags: AnyFlag) -> Mapping[str, AnyFlag]:
    """The flags by name, in their order."""
    return MappingProxyType({flag.name: flag for flag in flags})


def withholding(flags: Mapping[str, Flag]) -> frozenset[str]:
    """Names of the flags that withhold numbers."""
    return frozenset(name for name, flag in flags.items() if flag.withholds)
