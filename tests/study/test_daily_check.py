"""Daily checks: a log that cannot be changed, and charts that warn before the probe is out."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.cli.published import faults
from typer.testing import CliRunner

import tsis
from tsis.cli.study import app
from tsis.errors import InputError, RecordsError, TsisError
from tsis.files import encode_picture
from tsis.model import LightMap, TactileImage
from tsis.study.drift import (
    CHARTED,
    CheckLog,
    CheckPlan,
    DailyCheck,
    add_checks,
    begin_checks,
    daily_check,
    drift_charts,
    read_checks,
    rehearsed_checks,
)
from tsis.study.log import LOG_FILE
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from pathlib import Path

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
