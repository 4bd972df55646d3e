from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tomllib
from typing import TYPE_CHECKING

import pytest

from tsis.sweep.plan import EXAMPLE, parse_plan_text
from tsis.sweep.run import SweepSummary

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

SMALL = EXAMPLE.replace("count = 1024", "count = 8").replace("batch = 64", "batch = 4")


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    (tmp_path / "plan.toml").write_text(SMALL)
    return tmp_path / "plan.toml"


def test_the_example_is_a_plan(run_tsis: RunTsis) -> None:
    printed = run_tsis("sweep", "example").out
    assert tomllib.loads(printed)["sample"] == "sobol"
    assert parse_plan_text(printed).presses == 1024


@pytest.mark.system
@pytest.mark.usefixtures("plan")
def test_a_data_set_is_made_verified_and_kept(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("sweep", "run", "plan.toml", "--out", "data", "--workers", "1", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert (document["presses"], document["computed"], document["kept"], document["refused"]) == (8, 2, 0, 0)
    assert document["folder"] == str(tmp_path / "data")
    again = run_tsis("sweep", "run", "plan.toml", "--out", "data", "--workers", "1")
    assert "8 presses in 2 files, 0 computed now, 2 already present." in " ".join(again.out.split())
    assert "Research use only" in again.out
    verified = json.loads(run_tsis("sweep", "verify", "data", "--json").out)
    assert (verified["presses"], verified["shards"]) == (8, 2)
    assert "are as they were written" in run_tsis("sweep", "verify", "data").out
    (tmp_path / "data" / "part-000001.parquet").write_bytes(b"nothing")
    damaged = run_tsis("sweep", "verify", "data")
    assert damaged.code == 2
    assert "part-000001.parquet (damaged)" in damaged.err
    repaired = run_tsis("sweep", "run", "plan.toml", "--out", "data", "--workers", "1")
    assert "damaged or foreign, computed again: part-000001.parquet" in " ".join(repaired.out.split())


@pytest.mark.usefixtures("plan")
def test_a_sweep_whose_presses_are_all_refused_is_exit_code_3(
    run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def refused(number: int) -> int:
        done = SweepSummary(
            folder=str(tmp_path / "data"),
            presses=8,
            refused=number,
            shards=2,
            computed=2,
            kept=0,
            repaired=(),
            lost=0,
            seconds=1.0,
        )
        monkeypatch.setattr("tsis.sweep.run.run_sweep", lambda *_, **__: done)
        codes = [run_tsis("sweep", "run", "plan.toml", "--out", "data", *form).code for form in ((), ("--json",))]
        assert codes[0] == codes[1]
        return codes[0]

    assert [refused(number) for number in (0, 7, 8)] == [0, 0, 3]


def test_a_dry_run_says_how_much_and_writes_nothing(run_tsis: RunTsis, plan: Path) -> None:
    arguments = ("sweep", "run", "plan.toml", "--workers", "3", "--dry-run")
    document = json.loads(run_tsis(*arguments, "--json").out)
    assert (document["presses"], document["shards"], document["workers"]) == (8, 2, 3)
    assert document["estimated_seconds"] == pytest.approx(document["seconds_per_press"] * 8 / 3)
    assert "Nothing was computed or written" in run_tsis(*arguments).out
    assert list(plan.parent.iterdir()) == [plan]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["run", "absent.toml"], "'absent.toml' does not exist"),
        (["run", "."], "must be a file; got a folder"),
        (["run", "plan.toml", "--workers", "0"], "workers must lie in [1, 1024]; got 0"),
        (["run", "plan.toml", "--workers", "many"], "--workers"),
        (["run", "plan.toml", "--scheduler", "here"], "scheduler must be an address such as tcp://127.0.0.1:8786"),
        (["run", "plan.toml", "--out", "plan.toml"], "must be a folder that can be written"),
        (["run", "plan.toml", "--out", "x" * 300], "must be a folder that can be written"),
        (["run", "plan.toml", "--out", "."], "must be new, empty, or a folder that this plan began"),
        (["run", "wrong.toml"], "no key of a plan is called 'sead'; did you mean 'seed'?"),
        (["verify", "absent"], "does not exist"),
        (["verify", "."], "does not exist"),
        (["nothing"], "No such command 'nothing'"),
    ],
)
def test_wrong_input_is_one_sentence(run_tsis: RunTsis, plan: Path, arguments: list[str], sentence: str) -> None:
    (plan.parent / "wrong.toml").write_text("sead = 1\n" + SMALL)
    before = {path.name for path in plan.parent.iterdir()} | {"tsis-sweep"}
    finished = run_tsis("sweep", *arguments)
    assert finished.code == 2
    assert finished.out == ""
    assert sentence in finished.err
    assert finished.err.startswith("Error: ")
    assert finished.err.count("\n") == 1
    assert {path.name for path in plan.parent.iterdir()} <= before


def test_without_a_subcommand_help_is_shown(run_tsis: RunTsis) -> None:
    finished = run_tsis("sweep")
    assert finished.code == 0
    assert "tsis sweep example" in " ".join(finished.out.split())


@pytest.mark.parametrize("command", ["run", "verify", "example"])
def test_help_ends_with_an_example(run_tsis: RunTsis, command: str) -> None:
    finished = run_tsis("sweep", command, "--help")
    assert finished.code == 0
    assert f"Example: tsis sweep {command}" in " ".join(finished.out.split())


SWEEP_THAT_PRINTS = """
import sys
from contextlib import contextmanager
from tsis.cli import main, progress

@contextmanager
def printed(_description):
    yield lambda done, total: print(done, "files are there", flush=True)

progress.progress_bar = printed
sys.argv[0] = "tsis"
main()
"""


@pytest.mark.system
@pytest.mark.skipif(os.name != "posix", reason="sends a signal")
def test_an_interrupt_says_how_to_go_on(plan: Path) -> None:
    plan.write_text(SMALL.replace("count = 8", "count = 8192"))
    sweep = subprocess.Popen(
        [sys.executable, "-c", SWEEP_THAT_PRINTS, "sweep", "run", "plan.toml", "--out", "my data", "--workers", "1"],
        cwd=plan.parent,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert sweep.stdout is not None
    while sweep.stdout.readline() == "0 files are there\n":  # until the first file is
        pass
    os.killpg(sweep.pid, signal.SIGINT)  # as a terminal does, so that workers get it too
    out, err = sweep.communicate()
    assert sweep.returncode == 130
    assert set(out.split("\n")) <= {f"{count} files are there" for count in range(8193)} | {""}
    assert err == (
        "Interrupted; finished files stay. Resume with: tsis sweep run plan.toml --out 'my data' --workers 1\n"
    )
