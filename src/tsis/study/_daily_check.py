"""Daily checks of a probe on one phantom: a hash-chained log, and control charts that warn before it drifts out."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from typing import TYPE_CHECKING

from tsis.__about__ import __version__
from tsis.errors import InputError, RecordsError
from tsis.files import (
    EMPTY_CHAIN,
    LogChain,
    LogDraft,
    atomic_folder,
    file_error,
    from_json_value,
    link_entries,
    to_json_value,
)
from tsis.imaging import features
from tsis.model import freeze_mappings, require_integer, require_number
from tsis.study._folder import user
from tsis.study._log import LOG_FILE, append_log, read_log
from tsis.study._values import require_short_name

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from tsis.model import TactileImage


BEGUN, CHECKED = "checks begun", "checked"
CHARTED = {
    "light": ("light of the press", "grey levels per pixel and newton"),
    "peak": ("peak of the press", "grey levels per newton"),
    "diameter": ("diameter of the bright patch", "mm, or pixels without a scale"),
    "untouched": ("untouched face", "grey levels"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckPlan:
    """What all checks of a log have in common; ``tolerance`` is the relative drift at which the probe is out."""

    probe: str
    phantom: str
    force_n: float
    baseline: int = 20
    tolerance: float = 0.05

    def __post_init__(self) -> None:
        for name in ("probe", "phantom"):
            require_short_name(name, getattr(self, name))
        require_number("force_n", self.force_n, 1e-4, 50.0, hint="newtons")
        require_integer("baseline", self.baseline, 8, 300)
        require_number("tolerance", self.tolerance, 1e-3, 1.0, hint="a fraction of the baseline's mean")


@dataclass(frozen=True, slots=True, kw_only=True)
class DailyCheck:
    """One check: time with its offset from UTC, operator, values by the names of `CHARTED`, temperature if read."""

    at: datetime
    operator: str
    values: Mapping[str, float]
    temperature_c: float | None = None
    tsis: str = __version__

    def __post_init__(self) -> None:
        require_short_name("operator", self.operator)
        if set(self.values) != set(CHARTED):
            raise InputError(f"values must be {', '.join(CHARTED)}; got {', '.join(self.values)}")
        for name, value in self.values.items():
            require_number(name, value, -1e9, 1e9)
        if self.temperature_c is not None:
            require_number("temperature_c", self.temperature_c, -20.0, 80.0, hint="degrees Celsius")
        freeze_mappings(self, "values")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CheckLog:
    """The plan and the checks of a folder, and its log."""

    folder: Path
    plan: CheckPlan
    checks: tuple[DailyCheck, ...]
    chain: LogChain = field(repr=False)


def daily_check(
    press: TactileImage,
    untouched: TactileImage,
    *,
    force_n: float,
    at: datetime,
    operator: str = "",
    temperature_c: float | None = None,
) -> DailyCheck:
    """A check from raw frames of the press and of the untouched face; `InputError` when the press shows no contact."""
    require_number("force_n", force_n, 1e-4, 50.0, hint="newtons")
    of_press = features(press, untouched)
    if not of_press.contact:
        raise InputError("press must show a contact; it shows none above the noise: press the check phantom again")
    values = {
        "light": float((press.grey - untouched.grey).mean()) / force_n,
        "peak": of_press.peak / force_n,
        "diameter": of_press.equivalent_diameter_mm or of_press.equivalent_diameter_px,
        "untouched": float(untouched.grey.mean()),
    }
    return DailyCheck(at=at, operator=operator or user(), values=values, temperature_c=temperature_c)


def begin_checks(folder: Path, plan: CheckPlan, *, actor: str = "") -> CheckLog:
    """Create the folder of a log of checks; `RecordsError` when it exists."""
    draft_entry = LogDraft(
        actor=require_short_name("actor", actor or user()), action=BEGUN, content=to_json_value(plan)
    )
    line = link_entries(EMPTY_CHAIN, [draft_entry], datetime.now(UTC))[0].line()
    try:
        with atomic_folder(folder) as draft:
            (draft / LOG_FILE).write_bytes(f"{line}\n".encode())
    except OSError as error:
        reason = f"must be a new folder that can be written; got: {error.strerror}"
        raise file_error(folder, reason, RecordsError) from error
    return read_checks(folder)


def read_checks(folder: Path) -> CheckLog:
    """The checks of a folder; `RecordsError` when it holds none, or its log was changed."""
    return _parsed(folder, read_log(folder))


def add_checks(log: CheckLog, *checks: DailyCheck) -> CheckLog:
    """Append checks, none of them earlier than the last; `RecordsError` when the log was changed."""
    times = [item.at for item in (*log.checks[-1:], *checks)]
    if any(later < earlier for earlier, later in pairwise(times)):
        raise InputError(f"checks must come in order of time; the last is of {times[0].isoformat(timespec='minutes')}")
    drafts = [LogDraft(actor=item.operator, action=CHECKED, content=to_json_value(item)) for item in checks]
    return _parsed(log.folder, append_log(log.folder, lambda _: drafts, log_chain=log.chain))


def _parsed(folder: Path, chain: LogChain) -> CheckLog:
    if chain.breaks or not chain.entries or chain.entries[0].action != BEGUN:
        raise RecordsError(f"{folder / LOG_FILE} must be a whole log of daily checks; it was changed, or is another's")
    plan = from_json_value(CheckPlan, chain.entries[0].content, "plan of the checks")
    items = [from_json_value(DailyCheck, entry.content, "check") for entry in chain.entries[1:]]
    return CheckLog(folder=folder, plan=plan, checks=tuple(items), chain=chain)
