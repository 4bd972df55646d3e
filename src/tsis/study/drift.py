"""Drift of a probe: daily checks in a log, and control charts.

Charts have Shewhart and EWMA limits from a baseline, with the temperature's part removed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.__about__ import LARGEST_SEED, __version__
from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import load_probe
from tsis.errors import InputError, RecordsError
from tsis.files.atomic import atomic_folder
from tsis.files.hash_chain import EMPTY_CHAIN, LogChain, LogDraft, link_entries
from tsis.files.json_values import from_json_value, to_json_value
from tsis.files.reading import file_error
from tsis.imaging import features
from tsis.model.image import require_pixel_scale
from tsis.model.require import freeze_mappings, require_integer, require_number, require_pair
from tsis.study.folder import user
from tsis.study.log import LOG_FILE, append_log, read_log
from tsis.study.plan import require_short_name
from tsis.study.proportions import checked_readings
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from tsis.model.image import TactileImage


LEAST_BASELINE = 8
WIDTH = 3.0  # of the Shewhart limits, standard deviations of a normal variable
EWMA_WEIGHT, EWMA_WIDTH = 0.2, 2.962  # 500 checks on average between false alarms (Lucas and Saccucci 1990)
NODES = 80


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControlChart:
    """A chart of single values in order of time; arrays have the shape (checks,)."""

    #: values, baseline: all values, and how many of the first set the limits
    values: NDArray[np.float64]
    baseline: int
    #: centre, sd: mean and standard deviation of the baseline
    centre: float
    sd: float
    #: half width of the limits of a new value: Student's prediction interval with the probability of three sd
    shewhart: float
    ewma: NDArray[np.float64]  #: exponentially weighted mean of the values after the baseline; the centre during it
    ewma_half: NDArray[np.float64]  #: half widths of its limits; NaN during the baseline

    @property
    def beyond_shewhart(self) -> NDArray[np.bool_]:
        """Checks after the baseline with a value beyond the Shewhart limits."""
        late = np.arange(len(self.values)) >= self.baseline
        return late & (np.abs(self.values - self.centre) > self.shewhart)

    @property
    def beyond_ewma(self) -> NDArray[np.bool_]:
        """Checks after the baseline with a weighted mean beyond its limits."""
        with np.errstate(invalid="ignore"):
            return np.abs(self.ewma - self.centre) > self.ewma_half

    @property
    def first_warning(self) -> int | None:
        """Index of the first check that either rule marks; None without one."""
        marked = np.flatnonzero(self.beyond_shewhart | self.beyond_ewma)
        return int(marked[0]) if len(marked) else None


def control_chart(
    values: ArrayLike, *, baseline: int, weight: float = EWMA_WEIGHT, width: float = EWMA_WIDTH
) -> ControlChart:
    """Chart of values, shape (checks,), in order of time; Student's t widens both limits for the error of ``sd``.

    The first ``baseline`` values, 8 to 300, set the limits. After t checks the EWMA, in which the newest value has the
    weight w in (0, 1], has the variance ``sd² (w / (2 - w) (1 - (1 - w)^(2t)) + (1 - (1 - w)^t)² / baseline)``; the
    second part is the centre's. ``width`` is the half width of its limits in standard deviations of a long baseline.
    Raises `InputError` for a value out of range, or equal values in the baseline.

    Examples
    --------
    >>> steady = [10.0, 10.2, 9.9, 10.1, 9.8, 10.0, 10.1, 9.9]
    >>> control_chart([*steady, 10.1, 9.9, 10.7], baseline=8).first_warning
    10
    """
    taken = checked_readings("values", values, ndim=1)
    require_integer("baseline", baseline, LEAST_BASELINE, 300)
    require_number("weight", weight, 1e-3, 1.0)
    require_number("width", width, 0.5, 6.0)
    if len(taken) < baseline:
        raise InputError(f"values must be at least the {baseline} of the baseline; got {len(taken)}")
    first, late = taken[:baseline], taken[baseline:]
    centre, sd = float(first.mean()), float(first.std(ddof=1))
    if sd <= 1e-12 * abs(centre):
        raise InputError("values of the baseline must differ; got equal ones: record more digits")
    ewma, half = np.full(len(taken), centre), np.full(len(taken), np.nan)
    for index, value in enumerate(late, start=baseline):
        ewma[index] = (1 - weight) * ewma[index - 1] + weight * value
    fading = (1 - weight) ** np.arange(1, len(late) + 1)
    variance = weight / (2 - weight) * (1 - fading**2) + (1 - fading) ** 2 / baseline
    half[baseline:] = _student(width, baseline - 1) * sd * np.sqrt(variance)
    shewhart = _student(WIDTH, baseline - 1) * sd * math.sqrt(1 + 1 / baseline)
    return ControlChart(
        values=taken, baseline=baseline, centre=centre, sd=sd, shewhart=shewhart, ewma=ewma, ewma_half=half
    )


def _student(width: float, free: int) -> float:
    """The quantile of Student's t with the probability of ``width`` standard deviations of a normal variable."""
    return -float(scipy.special.stdtrit(free, scipy.special.ndtr(-width)))


def ewma_run_length(shift: float, *, weight: float = EWMA_WEIGHT, width: float = EWMA_WIDTH) -> float:
    """Mean number of checks to an EWMA alarm with steady limits and a known baseline (Crowder 1987).

    ``shift`` is that of the mean in standard deviations of a value, in [-6, 6].

    Examples
    --------
    >>> round(ewma_run_length(0.0)), round(ewma_run_length(1.0), 1)
    (500, 10.5)
    """
    require_number("shift", shift, -6.0, 6.0, hint="standard deviations")
    require_number("weight", weight, 0.01, 1.0)
    half = require_number("width", width, 0.5, 6.0) * math.sqrt(weight / (2 - weight))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    at = half * nodes
    step = (at[None, :] - (1 - weight) * at[:, None]) / weight - shift
    kernel = half / weight * weights * np.exp(-(step**2) / 2) / math.sqrt(2 * math.pi)
    lengths = np.linalg.solve(np.eye(NODES) - kernel, np.ones(NODES))
    start = (at / weight) - shift
    return 1 + float(half / weight * (weights * np.exp(-(start**2) / 2)) @ lengths / math.sqrt(2 * math.pi))


def shewhart_run_length(shift: float, *, width: float = WIDTH) -> float:
    """Mean number of checks to a Shewhart alarm with a known baseline; ``shift`` as `ewma_run_length`."""
    require_number("shift", shift, -6.0, 6.0, hint="standard deviations")
    return 1 / float(scipy.special.ndtr(-width - shift) + scipy.special.ndtr(-width + shift))


BEGUN, CHECKED = "checks begun", "checked"
SCALE_TOLERANCE = 0.01  # relative difference of the scales of checks
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
    """One check: time with its offset from UTC, operator, values by the names of `CHARTED`, temperature if read.

    ``mm_per_pixel`` is the scale (x, y) of its frames, empty where they have none, and their diameter is in pixels;
    None in logs that do not tell.
    """

    at: datetime
    operator: str
    values: Mapping[str, float]
    temperature_c: float | None = None
    mm_per_pixel: tuple[float, ...] | None = None
    tsis: str = __version__

    def __post_init__(self) -> None:
        require_short_name("operator", self.operator)
        if set(self.values) != set(CHARTED):
            raise InputError(f"values must be {', '.join(CHARTED)}; got {', '.join(self.values)}")
        for name, value in self.values.items():
            require_number(name, value, -1e9, 1e9)
        if self.temperature_c is not None:
            require_number("temperature_c", self.temperature_c, -20.0, 80.0, hint="degrees Celsius")
        if self.mm_per_pixel is not None:
            scale = tuple(self.mm_per_pixel)
            scale = require_pixel_scale(require_pair("mm_per_pixel", scale)) if scale else ()
            object.__setattr__(self, "mm_per_pixel", scale)
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
    return DailyCheck(
        at=at,
        operator=operator or user(),
        values=values,
        temperature_c=temperature_c,
        mm_per_pixel=press.mm_per_pixel or (),
    )


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
    """Append checks, none of them earlier than the last; `RecordsError` when the log was changed.

    `InputError` when the scale of one is not that of the first check, within 1 %: a chart has one unit.
    """
    times = [item.at for item in (*log.checks[-1:], *checks)]
    if any(later < earlier for earlier, later in pairwise(times)):
        raise InputError(f"checks must come in order of time; the last is of {times[0].isoformat(timespec='minutes')}")
    _require_one_scale([*log.checks, *checks])
    drafts = [LogDraft(actor=item.operator, action=CHECKED, content=to_json_value(item)) for item in checks]
    return _parsed(log.folder, append_log(log.folder, lambda _: drafts, log_chain=log.chain))


def _require_one_scale(checks: Sequence[DailyCheck]) -> None:
    """Refuse checks whose scale differs from that of the first one that tells."""
    told = [item.mm_per_pixel for item in checks if item.mm_per_pixel is not None]
    for scale in told[1:]:
        if len(scale) != len(told[0]) or not np.allclose(scale, told[0], rtol=SCALE_TOLERANCE, atol=0.0):
            raise InputError(
                f"mm_per_pixel must be that of the first check within {SCALE_TOLERANCE:.0%}, {_scale_text(told[0])}; "
                f"got {_scale_text(scale)} (give the same --scale-mm, or begin another folder of checks)"
            )


def _scale_text(scale: tuple[float, ...]) -> str:
    return " x ".join(f"{part:.4g}" for part in scale) + " mm" if scale else "none"


def _parsed(folder: Path, chain: LogChain) -> CheckLog:
    if chain.breaks or not chain.entries or chain.entries[0].action != BEGUN:
        raise RecordsError(f"{folder / LOG_FILE} must be a whole log of daily checks; it was changed, or is another's")
    plan = from_json_value(CheckPlan, chain.entries[0].content, "plan of the checks")
    items = [from_json_value(DailyCheck, entry.content, "check") for entry in chain.entries[1:]]
    return CheckLog(folder=folder, plan=plan, checks=tuple(items), chain=chain)


LEAST_KELVIN, SIGNIFICANT = 1.0, 3.0  # range of the baseline's temperatures, and its slope over its standard error
ROOM_C, ROOM_SD_C = 22.0, 1.5  # of the rehearsed room
LIGHT_PER_K, STIFFNESS_PER_K = -0.003, 0.003  # of lamps and elastomers
FIRST_DAY = datetime(2026, 1, 5, 8, tzinfo=UTC)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriftChart:
    """Chart of one value of the checks, with what the temperature explains removed where the baseline shows it.

    ``per_kelvin`` is the slope that was removed; None where temperatures are missing, varied too little, or do not
    matter. ``tolerance`` is the drift in the unit of the value at which the probe is out.
    """

    name: str
    chart: ControlChart
    per_kelvin: float | None
    tolerance: float

    @property
    def first_out(self) -> int | None:
        """Index of the first check whose weighted mean lies beyond the tolerance."""
        out = np.flatnonzero(np.abs(self.chart.ewma - self.chart.centre) > self.tolerance)
        return int(out[0]) if len(out) else None

    @property
    def warns(self) -> bool:
        """Whether the last check is beyond the limits of either rule."""
        return bool(self.chart.beyond_shewhart[-1] or self.chart.beyond_ewma[-1])


def drift_charts(log: CheckLog) -> tuple[DriftChart, ...]:
    """Charts of all values; `InputError` before the baseline is whole."""
    count, baseline = len(log.checks), log.plan.baseline
    if count < baseline:
        raise InputError(f"the baseline must hold {baseline} checks before a chart can warn; it holds {count}")
    degrees = np.array([np.nan if item.temperature_c is None else item.temperature_c for item in log.checks])
    charts = []
    for name in CHARTED:
        values = np.array([item.values[name] for item in log.checks])
        slope = _per_kelvin(values[:baseline], degrees)
        if slope is not None:
            values = values - slope * (degrees - degrees[:baseline].mean())
        chart = control_chart(values, baseline=baseline)
        tolerance = log.plan.tolerance * abs(chart.centre)
        charts.append(DriftChart(name=name, chart=chart, per_kelvin=slope, tolerance=tolerance))
    return tuple(charts)


def _per_kelvin(values: NDArray[np.float64], degrees: NDArray[np.float64]) -> float | None:
    """Slope over the temperature in the baseline, where it is significant and every check has one."""
    known = degrees[: len(values)]
    if np.isnan(degrees).any() or np.ptp(known) < LEAST_KELVIN:
        return None
    centred = known - known.mean()
    slope = float(centred @ values / (centred @ centred))
    rest = values - values.mean() - slope * centred
    error = float(np.sqrt(rest @ rest / (len(values) - 2) / (centred @ centred)))
    return slope if abs(slope) > SIGNIFICANT * error else None


def rehearsed_checks(
    log: CheckLog,
    count: int,
    *,
    seed: int,
    ageing: float,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[DailyCheck, ...]:
    """Daily checks of a virtual probe whose lamps lose the fraction ``ageing`` a day after the baseline.

    Its room changes by 1.5 degrees from day to day, which moves lamps and moduli by 0.3 % a degree. The probe itself
    follows from the log's plan and ``seed`` alone, so that further checks are of the same one.
    """
    require_integer("count", count, 1, 1000)
    require_integer("seed", seed, 0, LARGEST_SEED)
    require_number("ageing", ageing, 0.0, 0.05, hint="a fraction of the light a day")
    plan, begun = log.plan, len(log.checks)
    probe = VirtualProbe(load_probe(plan.probe), rng=np.random.default_rng([seed, 0]), strain="small")
    rng = np.random.default_rng([seed, 1, begun])
    phantom, first = load_phantom(plan.phantom), FIRST_DAY if not log.checks else log.checks[0].at
    made = []
    for day in range(begun, begun + count):
        warmer = ROOM_SD_C * float(rng.standard_normal())
        lamps = (1 - ageing) ** max(0, day - plan.baseline + 1) * (1 + LIGHT_PER_K * warmer)
        today = probe.aged(rng, lamps=lamps, stiffness=1 + STIFFNESS_PER_K * warmer)
        frames = today.press(phantom, force_n=plan.force_n), today.no_contact()
        at, room = first + timedelta(days=day), round(ROOM_C + warmer, 1)
        made.append(daily_check(*frames, force_n=plan.force_n, at=at, operator="virtual", temperature_c=room))
        if progress is not None:
            progress(day - begun + 1, count)
    return tuple(made)
