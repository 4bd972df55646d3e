"""A study as somebody types it, before it is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.console.pages.field_words import field_words
from tsis.console.pages.number_field import typed_number
from tsis.model.check import LARGEST_SEED, require_integer
from tsis.model.errors import InputError
from tsis.study import printed_targets, random_targets
from tsis.study.codes import TARGETS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.console.studies import StudyShelf
    from tsis.study import TargetTruth

LIKE = {"printed": "like the printed study", "random": "drawn by chance"}
WORDS = {"present": "targets with an inclusion", "blank": "blanks", "forces_n": "forces"}
MOST_FORCES = 16
MOST_REPEATS = 1000


@dataclass(slots=True)
class StudyDraft:
    """What is in the fields of a new study."""

    name: str = ""
    like: str = "printed"
    present: str = "8"
    blank: str = "8"
    forces: str = ""
    probe: str = "tsis-domed"
    with_reference: bool = True
    repeats: str = "1"
    threshold: str = "0.5"
    seed: str = ""

    def make(self, shelf: StudyShelf, *, actor: str) -> str:
        """Make the study, and return its name; `InputError` when a field holds what cannot be."""
        name = self.name.strip()
        with field_words(WORDS):
            shelf.make(
                name,
                self._targets(),
                seed=self._whole("seed", self.seed, 0, LARGEST_SEED) if self.seed.strip() else None,
                probe=self.probe,
                forces_n=self._forces(),
                with_reference=self.with_reference,
                repeats=self._whole("repeats", self.repeats, 1, MOST_REPEATS),
                threshold=typed_number("threshold", self.threshold),
                actor=actor,
            )
        return name

    def _targets(self) -> Sequence[TargetTruth] | Callable[[int], Sequence[TargetTruth]]:
        present = int(typed_whole(WORDS["present"], self.present))
        blank = int(typed_whole(WORDS["blank"], self.blank))
        if self.like == "random":
            return lambda seed: random_targets(present, blank, rng=np.random.default_rng([seed, TARGETS]))
        return printed_targets(present, blank)

    def _forces(self) -> tuple[float, ...] | None:
        parts = self.forces.replace(",", " ").replace(";", " ").split()
        if len(parts) > MOST_FORCES:
            raise InputError(f"forces must be at most {MOST_FORCES}; got {len(parts)}")
        return tuple(typed_number("force", part) for part in parts) or None

    @staticmethod
    def _whole(name: str, text: str, low: int, high: int) -> int:
        return require_integer(name, typed_whole(name, text), low, high)


def typed_whole(name: str, text: str) -> int:
    """The whole number that somebody typed; `InputError` when it is none."""
    value = typed_number(name, text)
    if not value.is_integer():
        raise InputError(f"{name} must be a whole number; got {text.strip()!r:.40}")
    return int(value)


__all__ = ["LIKE", "StudyDraft"]
