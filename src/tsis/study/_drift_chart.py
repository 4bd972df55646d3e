"""Control charts of the daily checks, with the temperature's part removed, and a rehearsal of drift."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import LARGEST_SEED
from tsis.catalog import load_phantom, load_probe
from tsis.detection import ControlChart, control_chart
from tsis.errors import InputError
from tsis.model import require_integer, require_number
from tsis.study._daily_check import CHARTED, CheckLog, DailyCheck, daily_check
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


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
