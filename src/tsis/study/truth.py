"""What a target of a study is: tissue, with an inclusion or without."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tsis.model import Inclusion, Phantom
from tsis.model.check import require_type
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

LONGEST_LABEL = 120
TISSUE = ("young_kpa", "poisson", "thickness_mm")
LUMP = ("diameter_mm", "depth_mm", "young_kpa", "poisson")


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetTruth:
    """A target as it is, told to nobody before the study is unblinded.

    Parameters
    ----------
    label
        What the maker of the study calls it.
    phantom
        Tissue, with one spherical inclusion or none.

    Raises
    ------
    InputError
        When the label is no short text, or the phantom holds several inclusions or one that is no sphere.
    """

    label: str
    phantom: Phantom

    def __post_init__(self) -> None:
        require_type("label", self.label, str)
        require_type("phantom", self.phantom, Phantom)
        if not 0 < len(self.label) <= LONGEST_LABEL or not self.label.isprintable():
            raise InputError(f"label must be 1 to {LONGEST_LABEL} printable letters; got {self.label!r:.80}")
        lump = self.phantom.inclusion
        if self.phantom.more_inclusions or (lump is not None and lump.semi_axes_mm is not None):
            raise InputError(f"phantom must hold one sphere or none; got {self.phantom.inclusions!r:.120}")

    @property
    def has_inclusion(self) -> bool:
        """Whether there is an inclusion."""
        return self.phantom.inclusion is not None

    @property
    def values(self) -> dict[str, float]:
        """Diameter, depth and modulus of the inclusion by the names of an estimate; empty where there is none."""
        lump = self.phantom.inclusion
        if lump is None:
            return {}
        return {"diameter_mm": lump.diameter_mm, "depth_mm": lump.depth_mm, "young_kpa": lump.young_kpa}

    def plain(self) -> dict[str, Any]:
        """As plain values, for a file."""
        lump = self.phantom.inclusion
        held = None
        if lump is not None:
            held = {**{name: getattr(lump, name) for name in LUMP}, "offset_mm": list(lump.offset_mm)}
        return {
            "label": self.label,
            "tissue": {name: getattr(self.phantom, name) for name in TISSUE},
            "inclusion": held,
        }


def parse_target_truth(plain: Mapping[str, Any]) -> TargetTruth:
    """The target that `TargetTruth.plain` wrote.

    Raises
    ------
    InputError
        When it holds something else.

    Examples
    --------
    >>> blank = TargetTruth(label="gel", phantom=Phantom(young_kpa=5.0, thickness_mm=30.0))
    >>> parse_target_truth(blank.plain()) == blank
    True
    """
    try:
        tissue, lump = plain["tissue"], plain["inclusion"]
        inclusion = None
        if lump is not None:
            inclusion = Inclusion(**{name: lump[name] for name in LUMP}, offset_mm=tuple(lump["offset_mm"]))
        phantom = Phantom(**{name: tissue[name] for name in TISSUE}, inclusion=inclusion)
        return TargetTruth(label=plain["label"], phantom=phantom)
    except (KeyError, TypeError, IndexError) as error:
        raise InputError(
            f"a target must hold label, tissue and inclusion as a study writes them; got {plain!r:.120}"
        ) from error


__all__ = ["TargetTruth", "parse_target_truth"]
