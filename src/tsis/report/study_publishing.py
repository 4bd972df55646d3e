"""From a study that has been read to its report: unblinded once, analysed, written, and entered in its log."""

from __future__ import annotations

import hashlib
import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.report.folder import free_folder, require_room, write_folder
from tsis.report.study import study_files
from tsis.study import analyse, enter_analysis, unblind
from tsis.study.folder import ANALYSED

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tsis.study import Study, StudyAnalysis

FOLDER = "analysis"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PublishedStudy:
    """A report that was written.

    Attributes
    ----------
    analysis
        What it says.
    study
        As it is with the entry of this analysis.
    folder
        Where the files lie.
    """

    analysis: StudyAnalysis
    study: Study
    folder: Path


def publish_study(
    study: Study, *, by: str, out: Path | None = None, progress: Callable[[int, int], None] | None = None
) -> PublishedStudy:
    """Unblind a study where it is blind still, analyse it and write the report.

    Parameters
    ----------
    study
        With one reading at least.
    by
        Who unblinds and analyses it.
    out
        Folder to write, a number is added when it exists; ``analysis`` in the study by default.
    progress
        Called with (done, total) devices.

    Raises
    ------
    FileInputError
        When the folder cannot be written.
    RecordsError
        When there is no reading, or the truth cannot be read.
    """
    place = _own_place(study) if out is None else free_folder(out)
    require_room(place)  # before what cannot be taken back
    for device in study.devices:
        study.threshold_of(device)
    analysis = analyse(unblind(study, by=by), progress=progress)
    files = study_files(analysis)
    folder = write_folder(place, files)
    inside = folder.name if folder.parent == study.folder.resolve() else ""
    told = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    return PublishedStudy(
        analysis=analysis, study=enter_analysis(analysis.study, by=by, folder=inside, files=told), folder=folder
    )


def _own_place(study: Study) -> Path:
    """A new folder in the study: a name that its log knows is not given again, though that report may be gone."""
    known = [entry.content.get("folder") for entry in study.chain.entries if entry.action == ANALYSED]
    names = itertools.chain([FOLDER], (f"{FOLDER}-{number}" for number in itertools.count(2)))
    return next(study.folder / name for name in names if name not in known and not (study.folder / name).exists())


__all__ = ["PublishedStudy", "publish_study"]
