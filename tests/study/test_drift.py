"""Control charts beside published run lengths and a simulation of alarms; daily checks in a log that cannot change."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import norm, t
from tests.cli.published import faults
from typer.testing import CliRunner

import tsis
from tsis.cli.study import app
from tsis.errors import InputError, RecordsError, TsisError
from tsis.files.images import encode_picture
from tsis.model.calibration import LightMap
from tsis.model.image import TactileImage
from tsis.study.drift import (
    CHARTED,
    CheckLog,
    CheckPlan,
    DailyCheck,
    add_checks,
    begin_checks,
    control_chart,
    daily_check,
    drift_charts,
    ewma_run_length,
    read_checks,
    rehearsed_checks,
    shewhart_run_length,
)
from tsis.study.log import LOG_FILE
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from pathlib import Path


# Lucas and Saccucci, Technometrics 32 (1990), as in Montgomery's table: weight and width, then lengths by shift.
SHIFTS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)
PUBLISHED = {
    (0.40, 3.054): (500, 224, 71.2, 28.4, 14.3, 5.9, 3.5, 2.0),
    (0.25, 2.998): (500, 170, 48.2, 20.1, 11.1, 5.5, 3.6, 2.3),
    (0.20, 2.962): (500, 150, 41.8, 18.2, 10.5, 5.5, 3.7, 2.4),
    (0.10, 2.814): (500, 106, 31.3, 15.9, 10.3, 6.1, 4.4, 2.9),
    (0.05, 2.615): (500, 84.1, 28.8, 16.4, 11.4, 7.1, 5.2, 3.5),
}


@pytest.mark.parametrize(("rule", "lengths"), PUBLISHED.items())
def test_run_lengths_are_those_of_the_published_table(rule: tuple[float, float], lengths: tuple[float, ...]) -> None:
    found = [ewma_run_length(shift, weight=rule[0], width=rule[1]) for shift in SHIFTS]
    assert found == pytest.approx(lengths, rel=0.007, abs=0.06)
    assert ewma_run_length(-1.0, weight=rule[0], width=rule[1]) == pytest.approx(found[4], rel=1e-9)


def test_run_lengths_are_those_of_a_simulation() -> None:
    rng, weight, width, shift = np.random.default_rng(8), 0.3, 2.4, 0.7
    half, runs = width * math.sqrt(weight / (2 - weight)), np.zeros(4000)
    ewma, alive = np.zeros(4000), np.ones(4000, dtype=bool)
    while alive.any():
        ewma = (1 - weight) * ewma + weight * (shift + rng.standard_normal(4000))
        runs += alive
        alive &= np.abs(ewma) <= half
    error = runs.std() / math.sqrt(len(runs))
    assert abs(ewma_run_length(shift, weight=weight, width=width) - runs.mean()) < 4 * error


def test_shewhart_run_lengths_are_those_of_independent_alarms() -> None:
    assert shewhart_run_length(0.0) == pytest.approx(1 / (2 * norm.sf(3)), rel=1e-12)
    assert shewhart_run_length(1.5) == pytest.approx(14.97, abs=0.01)  # Montgomery
    assert ewma_run_length(0.8, weight=1.0, width=3.0) == pytest.approx(shewhart_run_length(0.8), rel=1e-6)


def test_limits_follow_their_formulas() -> None:
    rng = np.random.default_rng(3)
    values = 5 + 0.2 * rng.standard_normal(30)
    chart = control_chart(values, baseline=12)
    spread = values[:12].std(ddof=1)
    assert chart.shewhart == pytest.approx(t.isf(norm.sf(3), 11) * spread * math.sqrt(13 / 12), rel=1e-9)
    weights = np.array([0.2 * 0.8 ** (17 - index) for index in range(18)])  # of the values after the baseline
    own = weights @ values[12:] + 0.8**18 * chart.centre
    assert chart.ewma[-1] == pytest.approx(own, rel=1e-12)
    variance = (weights**2).sum() + weights.sum() ** 2 / 12  # of the values, and of the centre that is subtracted
    assert chart.ewma_half[-1] == pytest.approx(t.isf(norm.sf(2.962), 11) * spread * math.sqrt(variance), rel=1e-9)


def test_a_short_baseline_warns_falsely_as_seldom_as_a_long_one() -> None:
    rng = np.random.default_rng(4)
    values = rng.standard_normal((40_000, 9))
    beyond = [control_chart(row, baseline=8).beyond_shewhart[-1] for row in values[:4000]]
    spread = values[:, :8].std(axis=1, ddof=1)
    far = np.abs(values[:, 8] - values[:, :8].mean(axis=1)) > spread * t.isf(norm.sf(3), 7) * math.sqrt(9 / 8)
    assert beyond == far[:4000].tolist()
    assert far.mean() == pytest.approx(2 * norm.sf(3), abs=4 * math.sqrt(0.0027 / 40_000))
    assert (np.abs(values[:, 8] - values[:, :8].mean(axis=1)) > 3 * spread).mean() > 4 * far.mean()  # naive limits


def test_a_slow_drift_is_seen_before_a_value_leaves() -> None:
    rng = np.random.default_rng(6)
    drift = np.concatenate([np.zeros(20), 0.1 * np.arange(1, 41)])
    chart = control_chart(rng.standard_normal(60) + drift, baseline=20)
    assert chart.first_warning is not None
    assert 20 <= chart.first_warning < 50
    assert not chart.beyond_shewhart[:20].any()


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        (np.ones(9), {"baseline": 8}, "values of the baseline must differ"),
        (np.arange(7.0), {"baseline": 8}, "values must be at least the 8 of the baseline; got 7"),
        (np.arange(9.0), {"baseline": 3}, "baseline must"),
        (np.arange(9.0), {"baseline": 8, "weight": 0.0}, "weight must lie in"),
    ],
)
def test_bad_input_is_refused(values: np.ndarray, options: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        control_chart(values, **options)  # type: ignore[arg-type]


PLAN = CheckPlan(probe="tsis-2011", phantom="size-8", force_n=1.0, baseline=12, tolerance=0.05)
START = datetime(2026, 3, 2, 8, tzinfo=UTC)


def checks(
    count: int, *, seed: int, daily: float = 0.0, per_kelvin: float = 0.0, temperatures: bool = True
) -> list[DailyCheck]:
    """Checks with a scatter of 1 %, whose light falls by ``daily`` after the baseline and by the temperature."""
    rng, made = np.random.default_rng(seed), []
    for day in range(count):
        warmer = 2.0 * float(rng.standard_normal())
        light = (1 - daily) ** max(0, day - 11) * (1 + per_kelvin * warmer + 0.01 * float(rng.standard_normal()))
        values = {name: light + 1e-3 * float(rng.standard_normal()) for name in CHARTED}
        degrees = 22 + warmer if temperatures else None
        made.append(DailyCheck(at=START + timedelta(days=day), operator="Ada", values=values, temperature_c=degrees))
    return made


def begun(folder: Path, made: list[DailyCheck]) -> CheckLog:
    return add_checks(begin_checks(folder, PLAN, actor="Ada"), *made)


def test_checks_are_read_back_and_a_changed_log_is_refused(tmp_path: Path) -> None:
    log = begun(tmp_path / "c", checks(3, seed=1))
    again = read_checks(tmp_path / "c")
    assert (again.plan, again.checks, again.chain.head) == (log.plan, log.checks, log.chain.head)
    file = tmp_path / "c" / LOG_FILE
    file.write_text(file.read_text().replace('"operator":"Ada"', '"operator":"Eve"', 1))
    with pytest.raises(RecordsError, match="must be a whole log of daily checks; it was changed"):
        read_checks(tmp_path / "c")


def test_checks_come_in_order_and_the_baseline_must_be_whole(tmp_path: Path) -> None:
    made = checks(3, seed=1)
    log = begun(tmp_path / "c", made)
    with pytest.raises(InputError, match="checks must come in order of time"):
        add_checks(log, replace(made[0], operator="Eve"))
    with pytest.raises(InputError, match="the baseline must hold 12 checks before a chart can warn; it holds 3"):
        drift_charts(log)
    with pytest.raises(RecordsError, match="must be a new folder"):
        begin_checks(tmp_path / "c", PLAN, actor="Ada")


def test_ageing_warns_before_the_probe_is_out(tmp_path: Path) -> None:
    light = drift_charts(begun(tmp_path / "c", checks(60, seed=11, daily=0.0025)))[0]
    assert light.chart.first_warning is not None
    assert light.first_out is not None
    assert light.chart.first_warning < light.first_out - 5
    assert light.warns


def test_steady_probes_seldom_warn(tmp_path: Path) -> None:
    calm = [
        drift_charts(begun(tmp_path / str(seed), checks(30, seed=seed)))[0].chart.first_warning is None
        for seed in range(20, 40)
    ]
    assert sum(calm) >= 17  # about one in 20 warns once within 18 checks


def test_temperature_is_removed_where_the_baseline_shows_its_effect(tmp_path: Path) -> None:
    chart = drift_charts(begun(tmp_path / "c", checks(40, seed=2, per_kelvin=-0.02)))[0]
    assert chart.per_kelvin == pytest.approx(-0.02, abs=0.006)
    assert chart.chart.sd < 0.02  # 4 % come from the temperature
    unread = drift_charts(begun(tmp_path / "d", checks(40, seed=2, per_kelvin=-0.02, temperatures=False)))[0]
    assert unread.per_kelvin is None
    assert unread.chart.sd > 0.03


def blob(light: float = 1.0) -> TactileImage:
    """A bright patch of 100 grey levels times ``light`` on a background of 8."""
    x, y = np.meshgrid(np.linspace(-12, 12, 96), np.linspace(-10, 10, 80))
    grey = 8 + 100 * light * np.exp(-(x**2 + y**2) / 18)
    return TactileImage(grey=grey, mm_per_pixel=(24 / 95, 20 / 79))


def written(folder: Path, *, light: float = 1.0) -> list[str]:
    """Options that give the frames of a day."""
    options = []
    for name, frame in (("press", blob(light)), ("untouched", blob(0.0))):
        (folder / f"{name}.png").write_bytes(encode_picture(frame.grey.round().astype(np.uint8)))
        options += [f"--{name}", str(folder / f"{name}.png")]
    return [*options, "--json"]


def test_a_check_is_read_from_two_frames(tmp_path: Path) -> None:
    frames = blob(), blob(0.0)
    one, two = (daily_check(*frames, force_n=force, at=START, operator="Ada") for force in (1.0, 2.0))
    assert one.values["light"] == pytest.approx(2 * two.values["light"])
    less = daily_check(blob(0.9), frames[1], force_n=1.0, at=START, operator="Ada")
    assert less.values["light"] / one.values["light"] == pytest.approx(0.9, abs=1e-3)
    with pytest.raises(InputError, match="press must show a contact"):
        daily_check(frames[1], frames[1], force_n=1.0, at=START)
    done = CliRunner().invoke(app, ["check", str(tmp_path / "log"), *written(tmp_path), "--operator", "Ada"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.output)
    assert (document["checks"], document["warns"], faults(document)) == (1, False, [])


def test_the_command_warns_with_its_exit_code(tmp_path: Path) -> None:
    begun(tmp_path / "log", checks(50, seed=11, daily=0.004))
    done = CliRunner().invoke(app, ["check", str(tmp_path / "log"), "--out", str(tmp_path / "out"), *written(tmp_path)])
    assert done.exit_code == 3, done.output
    document = json.loads(done.output)
    assert document["warns"]
    assert faults(document) == []
    assert (tmp_path / "out" / "report.pdf").read_bytes().startswith(b"%PDF")
    refused = CliRunner().invoke(app, ["check", str(tmp_path / "log")])
    assert isinstance(refused.exception, InputError)
    assert "a check needs --press and --untouched" in str(refused.exception)


def test_a_first_check_that_is_refused_fixes_no_plan(tmp_path: Path) -> None:
    """Nor does a later one press with another force in silence."""
    folder, options = tmp_path / "log", written(tmp_path)
    empty = tmp_path / "empty.png"
    empty.write_bytes(b"")
    for refused in (["--press", str(empty), *options[2:]], [*options, "--force-n", "nan"]):
        assert isinstance(CliRunner().invoke(app, ["check", str(folder), *refused]).exception, TsisError)
        assert not folder.exists()
    assert CliRunner().invoke(app, ["check", str(folder), *options, "--force-n", "2"]).exit_code == 0
    for force in ("1", "nan"):
        done = CliRunner().invoke(app, ["check", str(folder), *options, "--force-n", force])
        assert isinstance(done.exception, InputError)
    assert CliRunner().invoke(app, ["check", str(folder), *options]).exit_code == 0
    press, untouched = (replace(frame, grey=frame.grey.round()) for frame in (blob(), blob(0.0)))
    light = daily_check(press, untouched, force_n=2.0, at=START).values["light"]
    assert [item.values["light"] for item in read_checks(folder).checks] == pytest.approx([light, light])


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--probe", "tsis-domed"), "--probe must be tsis-2011, as at the first check; got tsis-domed"),
        (("--phantom", "size-3"), "--phantom must be size-8, as at the first check; got size-3"),
        (("--baseline", "9"), "--baseline must be 8, as at the first check; got 9"),
        (("--tolerance", "0.5"), "--tolerance must be 0.05, as at the first check; got 0.5"),
        (("--seed", "3", "--ageing", "0.01"), "--ageing and --seed must be left out with frames"),
    ],
)
def test_a_later_check_does_not_ignore_an_option(options: tuple[str, ...], told: str, tmp_path: Path) -> None:
    folder, frames = str(tmp_path / "log"), written(tmp_path)
    first = ["--probe", "tsis-2011", "--phantom", "size-8", "--baseline", "8", "--tolerance", "0.05"]
    for _ in range(2):  # the second gives the same again
        assert CliRunner().invoke(app, ["check", folder, *frames, *first]).exit_code == 0
    refused = CliRunner().invoke(app, ["check", folder, *frames, *options])
    assert isinstance(refused.exception, InputError)
    assert told in str(refused.exception)
    assert len(read_checks(tmp_path / "log").checks) == 2


def test_a_rehearsal_refuses_options_of_frames(tmp_path: Path) -> None:
    options = ["--rehearse", "1", "--scale-mm", "0.1", "--temperature-c", "30", "--operator", "Ada"]
    refused = CliRunner().invoke(app, ["check", str(tmp_path / "log"), *options])
    assert "--scale-mm and --temperature-c and --operator must be left out" in str(refused.exception)
    assert not (tmp_path / "log").exists()


def test_checks_of_one_log_have_one_scale(tmp_path: Path) -> None:
    options = written(tmp_path)

    def check(folder: str, *scale: str) -> BaseException | None:
        return CliRunner().invoke(app, ["check", str(tmp_path / folder), *options, *scale]).exception

    assert check("mm", "--scale-mm", "0.1") is None
    assert check("mm", "--scale-mm", "0.1005,0.0995") is None
    for scale, got in (((), "got none"), (("--scale-mm", "0.102"), "got 0.102 x 0.102 mm")):
        refused = check("mm", *scale)
        assert isinstance(refused, InputError)
        assert "mm_per_pixel must be that of the first check within 1%, 0.1 x 0.1 mm" in str(refused)
        assert got in str(refused)
    scales = [item.mm_per_pixel for item in read_checks(tmp_path / "mm").checks]
    assert scales == [(0.1, 0.1), (0.1005, 0.0995)]
    assert check("px") is None
    assert isinstance(check("px", "--scale-mm", "0.1"), InputError)
    assert len(read_checks(tmp_path / "px").checks) == 1


def test_a_log_that_does_not_tell_its_scale_goes_on(tmp_path: Path) -> None:
    log = begun(tmp_path / "log", checks(3, seed=1))
    late = replace(log.checks[-1], at=START + timedelta(days=9))
    log = add_checks(log, replace(late, mm_per_pixel=(0.1, 0.1)))
    with pytest.raises(InputError, match="mm_per_pixel must be that of the first check"):
        add_checks(log, replace(late, mm_per_pixel=()))
    with pytest.raises(InputError, match="mm_per_pixel must"):
        replace(late, mm_per_pixel=(0.1,))


@pytest.mark.slow
def test_the_virtual_probe_is_checked_and_rehearsed(tmp_path: Path) -> None:
    probe = VirtualProbe(
        tsis.load_probe("tsis-2011"), rng=np.random.default_rng(1), strain="small", light=LightMap.uniform()
    )
    untouched = probe.no_contact()
    press, darker = (
        one.press(tsis.load_phantom("size-8"), force_n=1.0)
        for one in (probe, probe.aged(np.random.default_rng(9), lamps=0.9))
    )
    one, less = (daily_check(frame, untouched, force_n=1.0, at=START) for frame in (press, darker))
    assert less.values["light"] / one.values["light"] == pytest.approx(0.9, abs=0.04)
    begun(tmp_path / "log", checks(50, seed=11, daily=0.004))
    options = ["--rehearse", "1", "--seed", "1", "--json", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, ["check", str(tmp_path / "log"), *options])
    assert done.exit_code == 3, done.output


@pytest.mark.slow
def test_a_rehearsed_probe_warns_before_it_is_out(tmp_path: Path) -> None:
    log = begin_checks(tmp_path / "c", replace(PLAN, baseline=20), actor="Ada")
    log = add_checks(log, *rehearsed_checks(log, 60, seed=41, ageing=0.002))
    light = drift_charts(log)[0]
    assert light.chart.first_warning is not None
    assert light.first_out is not None
    assert light.chart.first_warning < light.first_out


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 43])
def test_a_rehearsal_goes_on_with_the_same_probe(tmp_path: Path, seed: int) -> None:
    """Two probes differ in diameter by ten times what the presses of one do."""
    log = begin_checks(tmp_path / "c", PLAN, actor="Ada")
    for count in (10, 5):
        log = add_checks(log, *rehearsed_checks(log, count, seed=seed, ageing=0.0))
    diameter = np.array([check.values["diameter"] for check in log.checks])
    assert len({check.values["light"] for check in log.checks}) == 15
    assert abs(diameter[10:].mean() - diameter[:10].mean()) < 4 * diameter[:10].std(ddof=1)
