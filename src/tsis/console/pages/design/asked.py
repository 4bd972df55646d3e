"""What is asked of a probe, as somebody types it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tsis.console.pages.field_words import FORCE, field_words
from tsis.console.pages.number_field import typed_number
from tsis.inclusion.design_protocol import MOST_FRAMES
from tsis.inclusion.design_search import MOST_EVALUATIONS
from tsis.model.check import require_integer
from tsis.model.errors import InputError
from tsis.report.design_question import QUICK, DesignQuestion

if TYPE_CHECKING:
    from tsis.model import Probe

COMPARED = {
    "softness": "softer and stiffer layers",
    "layers": "one modulus; layers in reverse",
    "dome": "flat face, other domes",
    "forces": "other forces",
    "frames": "more frames of each press",
    "reference": "with and without a reference",
}
CRITERIA = {"all": "all three together", "diameter_mm": "diameter", "depth_mm": "depth", "young_kpa": "modulus"}
MOST_FORCES = 8


@dataclass(slots=True)
class AskedDraft:
    """What is in the fields of presses and question."""

    forces: str = ""
    frames: str = "1"
    with_reference: bool = True
    compared: set[str] = field(default_factory=lambda: set(QUICK))
    criterion: str = "all"
    traced: bool = False
    search: bool = False
    evaluations: str = str(MOST_EVALUATIONS)

    def question(self, probe: Probe) -> DesignQuestion:
        """The question about a probe; `InputError` when a field holds what cannot be asked."""
        with field_words(FORCE):
            return DesignQuestion(
                probe=probe,
                forces_n=self.forces_n(),
                with_reference=self.with_reference,
                frames_each=require_integer("frames", typed_number("frames", self.frames), 1, MOST_FRAMES),
                compared=tuple(aspect for aspect in COMPARED if aspect in self.compared),
                criterion=self.criterion,
                traced=self.traced,
                evaluations=self._evaluations() if self.search else None,
            )

    def _evaluations(self) -> int:
        name = "stacks to try"
        return require_integer(name, typed_number(name, self.evaluations), 1, MOST_EVALUATIONS)

    def forces_n(self) -> tuple[float, ...]:
        """Forces as typed with commas or spaces between them; none when the field is empty."""
        parts = self.forces.replace(",", " ").replace(";", " ").split()
        if len(parts) > MOST_FORCES:
            raise InputError(f"forces must be at most {MOST_FORCES}; got {len(parts)}")
        return tuple(typed_number("force", part) for part in parts)
