"""How far an estimate moves under other priors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError
from tsis.inclusion._estimate import estimate
from tsis.inclusion._prior import PARAMETERS
from tsis.model import TactileImage, label_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.inclusion._prior import InclusionPrior
    from tsis.model import Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorShift:
    """The same presses under another prior.

    Attributes
    ----------
    name
        Of the other prior.
    shift_sd
        Difference of the means, other prior minus own, over the own standard deviation, by parameter; without the
        parameters that one of the two does not identify, and empty where one of the two is not trusted.
    reason
        Why there is no shift; empty where there is one.
    """

    name: str
    shift_sd: Mapping[str, float]
    reason: str = ""

    def __str__(self) -> str:
        if not self.shift_sd:
            return f"{self.name}: {self.reason}"
        moved = ", ".join(f"{label_of(name)} {shift:+.1f} sd" for name, shift in self.shift_sd.items())
        return f"{self.name}: {moved}"


def prior_sensitivity(
    own: Estimate, images: Sequence[TactileImage], priors: Mapping[str, InclusionPrior], **call: Any
) -> tuple[PriorShift, ...]:
    """Estimate the presses again under each of the ``priors``, by name.

    ``call`` are the other arguments of `estimate`; the tables of another prior are built once. A press that another
    prior does not allow is told in the shift's ``reason``.
    """
    shifts = []
    for name, prior in priors.items():
        try:
            other = estimate(images, **{**call, "prior": prior})
        except InputError as error:
            shifts.append(PriorShift(name=name, shift_sd={}, reason=f"no estimate ({error})"))
            continue
        if not (own.trusted and other.trusted):
            shifts.append(PriorShift(name=name, shift_sd={}, reason="not trusted" if own.trusted else "not compared"))
            continue
        known = [one for one in PARAMETERS if own.identified(one) and other.identified(one)]
        moved = {one: (other.mean[one] - own.mean[one]) / own.sd[one] for one in known}
        shifts.append(PriorShift(name=name, shift_sd=moved, reason="" if moved else "nothing identified"))
    return tuple(shifts)


def with_prior_sensitivity(own: Estimate, shifts: Sequence[PriorShift]) -> Estimate:
    """The estimate with a sentence on its shifts in its notes, which every result prints.

    The notes of an untrusted estimate belong to its flags one by one, and are withheld with them; so the sentence,
    which holds no number then, ends the last note that is printed.
    """
    message = f"Under other priors: {'; '.join(map(str, shifts))}."
    if own.trusted:
        return replace(own, notes=(*own.notes, message))
    if not own.printed_notes:
        return own
    place = len(own.notes) - 1 - own.notes[::-1].index(own.printed_notes[-1])
    return replace(own, notes=(*own.notes[:place], f"{own.notes[place]} {message}", *own.notes[place + 1 :]))
