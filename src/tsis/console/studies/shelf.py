"""Where the studies of a console lie: a name is one of a folder and never a path."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.console.statuses import AbsentError
from tsis.instrument.file_bytes import one_line
from tsis.model.errors import InputError, RecordsError, TsisError
from tsis.study import new_study, open_study
from tsis.study.folder import PLAN
from tsis.study.log import LOG_FILE

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path
    from typing import Any

    from tsis.study import Study, TargetTruth

FOLDER = "studies"
NAME = re.compile(r"[A-Za-z0-9_-]{1,60}", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyGlimpse:
    """A study in a list.

    Attributes
    ----------
    name
        Of its folder.
    targets, readings
        How many.
    unblinded
        When and by whom; empty while it is blind.
    trouble
        Why it cannot be read; empty where it can.
    """

    name: str
    targets: int = 0
    readings: int = 0
    unblinded: str = ""
    trouble: str = ""


class StudyShelf:
    """The studies below a workspace.

    Parameters
    ----------
    workspace
        Of the console.
    """

    def __init__(self, workspace: Path) -> None:
        self._folder = workspace / FOLDER

    def names(self) -> tuple[str, ...]:
        """Of the studies that are there, in the order of the alphabet."""
        try:
            found = sorted(each.name for each in self._folder.iterdir() if (each / PLAN).is_file())
        except FileNotFoundError:
            return ()
        except OSError as error:
            raise RecordsError(f"the folder of studies must be readable; got: {error.strerror or error}") from error
        return tuple(name for name in found if NAME.fullmatch(name))

    def place(self, name: str) -> Path:
        """Folder of the study of that name; `AbsentError` when there is none."""
        if not NAME.fullmatch(name):
            raise AbsentError(
                f"name of a study must be 1 to 60 letters, digits, dashes and underscores; got {name!r:.80}"
            )
        if not (self._folder / name / PLAN).is_file():
            raise AbsentError(f"study must be one of this console's; there is none of the name {name!r}")
        return self._folder / name

    def study(self, name: str) -> Study:
        """The study of that name as it is now; errors as `place` and `tsis.study.open_study`."""
        return open_study(self.place(name))

    def make(
        self, name: str, targets: Sequence[TargetTruth] | Callable[[int], Sequence[TargetTruth]], **terms: Any
    ) -> Study:
        """Make a study; ``terms`` and errors as of `tsis.study.new_study`."""
        if not NAME.fullmatch(name):
            raise InputError(f"name must be 1 to 60 letters, digits, dashes and underscores; got {name!r:.80}")
        if (self._folder / name).exists():
            raise InputError(f"name must be a new one; there is {name!r} already (choose another)")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordsError(f"the folder of studies must be writable; got: {error.strerror or error}") from error
        return new_study(self._folder / name, targets, **terms)

    def glimpses(self) -> tuple[StudyGlimpse, ...]:
        """All studies; one that cannot be read says why."""
        return tuple(self._glimpse(name) for name in self.names())

    def stamp(self, name: str) -> tuple[int, int]:
        """Another pair of numbers whenever the log of a study has changed; zeros where there is none."""
        try:
            found = (self._folder / name / LOG_FILE).stat()
        except OSError:
            return 0, 0
        return found.st_mtime_ns, found.st_size

    def stamps(self) -> tuple[tuple[str, tuple[int, int]], ...]:
        """The same of all studies, by their names."""
        return tuple((name, self.stamp(name)) for name in self.names())

    def _glimpse(self, name: str) -> StudyGlimpse:
        try:
            study = self.study(name)
        except TsisError as error:
            return StudyGlimpse(name=name, trouble=one_line(error))
        return StudyGlimpse(
            name=name,
            targets=len(study.plan.codes),
            readings=len(study.readings),
            unblinded=unblinded_words(study),
        )


def unblinded_words(study: Study) -> str:
    """When and by whom a study was unblinded; empty while it is blind."""
    entry = study.unblinded
    return "" if entry is None else one_line(f"{entry.moment[:16].replace('T', ' ')} UTC by {entry.actor}")


__all__ = ["FOLDER", "StudyGlimpse", "StudyShelf", "unblinded_words"]
