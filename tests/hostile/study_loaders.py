"""Loaders of blinded studies: the log, the plan and the sealed truth, each changed beside the others as they were."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from tests.hostile.loader import Loader

from tsis.errors import RecordsError
from tsis.files.hash_chain import read_chain
from tsis.study.folder import new_study, open_study, printed_targets, read_seal, verify_study
from tsis.study.log import LOG_FILE
from tsis.study.readings import import_readings

if TYPE_CHECKING:
    from collections.abc import Hashable

    from tsis.study.folder import Study

HEADINGS = b"code,score,operator,repeat,diameter_mm,depth_mm,young_kpa\n"


def study_loaders() -> tuple[Loader, ...]:
    """The files of a study."""
    files = _study()
    return tuple(
        Loader(
            name=f"study: {name}",
            file=name,
            originals=(files[name],),
            around={other: content for other, content in files.items() if other != name},
            load=_told,
            integrity=True,
            text=True,
            share=0.3,
        )
        for name in files
    )


@cache
def _study() -> dict[str, bytes]:
    """Every file of a small study with readings."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "study"
        study = new_study(folder, printed_targets(2, 2), seed=1, actor="maker")
        table = Path(place) / "readings.csv"
        table.write_bytes(HEADINGS + b"".join(f"{code},0.5,Ada,1,,,\n".encode() for code in study.plan.codes))
        import_readings(study, table, device="feeler", actor="Ada")
        return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@cache
def _head() -> str:
    """Hash of the last line of the log as it was written."""
    return read_chain(_study()[LOG_FILE]).head


def _told(path: Path) -> Hashable:
    """A study that is as it was written, with its truth; refused where `verify_study` finds a fault.

    The head that was written down is asked for: without it nobody can tell that lines were cut off the log's end.
    """
    study = open_study(path.parent)
    found = verify_study(path.parent, head=_head())
    if not found.sound:
        raise RecordsError(f"a study must be as it was written; {found.faults[0]}")
    return _words(study)


def _words(study: Study) -> Hashable:
    seal, unchanged = read_seal(study)
    return str(study.plan), tuple(map(str, study.readings)), str(sorted(seal.truths.items())), unchanged
