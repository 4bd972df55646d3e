"""What a tab has on its drawing desk."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tsis.console.pages.design.asked import AskedDraft
from tsis.console.pages.design.draft import ProbeDraft, draft_of

if TYPE_CHECKING:
    from tsis.console.bench import Job

FIRST = "tsis-domed"


@dataclass(slots=True)
class DrawingDesk:
    """Drafts, and the job that judges them or did so last."""

    probe: ProbeDraft = field(default_factory=lambda: draft_of(FIRST))
    asked: AskedDraft = field(default_factory=AskedDraft)
    job: Job | None = None
