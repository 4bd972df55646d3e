"""The examples of all commands in an order in which a newcomer can type them, and the folder to type them in."""

from __future__ import annotations

import json
import os
import shlex
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import typer.main
from tests.cli.test_detect import enter
from tests.cli.test_program import parsers

from tsis.cli.app import app
from tsis.model.phantom import Inclusion
from tsis.records.store import open_store
from tsis.study.kit import MODULUS_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

PROGRAM = "import sys; sys.argv[0] = 'tsis'; from tsis.cli import main; main()"


@dataclass(frozen=True)
class Step:
    """An example: its command, what it prints (a regular expression) and writes, and what ends or answers it.

    ``serves`` begins the line after which Ctrl-C ends it; ``typed`` is standard input.
    """

    command: str
    prints: str
    writes: tuple[str, ...] = ()
    typed: str = ""
    serves: str = ""

    @property
    def words(self) -> tuple[str, ...]:
        return tuple(self.command.split())


REPORT = ("index.html", "result.json")
CALIBRATED = (*REPORT, "calibration.json")

WALK = (
    Step("doctor", r"tsis +ok"),
    Step("demo", r"diameter", tuple(f"first-press/{name}" for name in (*CALIBRATED, "target-1N.png", "untouched.png"))),
    Step("examine", r"diameter", tuple(f"tsis-examine/{name}" for name in REPORT)),
    Step("compare", r"relative size", tuple(f"tsis-compare/{name}" for name in REPORT)),
    Step("simulate", r'"name": "tsis-simulate-scan"', ("scan/poses.csv", "scan/truth.json")),
    Step("map", r"lump 1", ("map/index.html", "map/result.json", "map/map.vti")),
    Step("acquire", r"12 frames in", ("press-1/frame-000011.png", "press-1/recording.json")),
    Step("track", r"path by noise", tuple(f"tsis-track/{name}" for name in REPORT)),
    Step("design", r"frames of each press: 16", ("design/result.json", "design/*.png")),
    Step("protocol", r"Press at 0\.96 N and 1\.9 N"),
    Step("hardness", r"Shore", tuple(f"first-touch/{name}" for name in CALIBRATED)),
    Step("indent", r"press\.csv"),
    Step("sensor new", r"File: my-gel.toml", ("my-gel.toml",)),
    Step("sensor check", r"0\.0634"),
    Step("sensor show", r"gsrobotics"),
    Step("sensor frames", r"4 presses", ("gel-frames/press-4.png", "gel-frames/untouched.png")),
    Step("session", r"presses\.csv", ("gel-frames/presses.csv",)),
    Step("contacts", r"good"),
    Step("depth calibrate", r"presses left out", ("depth.json",)),
    Step("depth map", r"deepest", ("depth-maps/press-4.npy", "depth-maps/press-4.ply")),
    Step("force", r"normal force", ("first-force/pressure.png", "first-force/result.json")),
    Step("serve", r"Ended; \d+ frames were sent", serves="Read it with: "),
    Step("calibrate guide", r"first", tuple(f"first/{name}" for name in CALIBRATED)),
    Step("calibrate make", r"tsis-calibration", tuple(f"tsis-calibration/{name}" for name in CALIBRATED)),
    Step("calibrate light", r"gain on tissue over that of the tips"),
    Step("calibrate show", r"scale x +0\.03\d+ mm/px"),
    Step("calibrate seal", r"calibration\.json", ("calibration.json",)),
    Step("login add", r"anna may log in", ("user/*",), typed="correct horse battery\n"),
    Step("login list", r'"name": "anna"'),
    Step("login remove", r"anna may no longer log in"),
    Step("console", r"Ended; saved data are in the store", ("user/*",), serves="Open "),
    Step("match", r"matched", ("moved.csv", "moved.png")),
    Step("detect train", r"stiffer than 60 kPa", ("classifier.json",)),
    Step("detect apply", r"stiffer than 60 kPa"),
    Step("network train", r"Trained networks", ("networks.json",)),
    Step("network apply", r"target-1N\.png"),
    Step("optics propagate", r"guided", ("pressed-guide/*.png",)),
    Step("optics angles", r"glass +1\."),
    Step("optics modes", r"guided TE modes", ("modes/*.png",)),
    Step("optics trace", r"100[, ]?000 rays|rays", ("rays/*.png",)),
    Step("records import", r"5 presses", ("records/**/*.png",)),
    Step("records list", r"size-8 +5"),
    Step("records show", r"diameter"),
    Step("records verify", r"18 rows and 7 files"),
    Step("records backup", r"18 rows and 7 files", ("records-backup/**/*.png",)),
    Step("records restore", r"18 rows and 7 files", ("restored-records/**/*.png",)),
    Step("records recompute", r"bit for bit the same"),
    Step("records edit", r"Changed note, name of target 1"),
    Step("records export", r"target-1", ("target-1/*.pdf", "target-1/target-1-csv/*")),
    Step("study new", r"4 targets", ("trial/study.json", "trial/sealed.json")),
    Step("study show", r"4 targets"),
    Step("study run", r"8 readings entered", ("trial/log*",)),
    Step("study export", r"readings\.csv", ("readings.csv",)),
    Step("study import", r"\b8 readings"),
    Step("study verify", r"as it was written, all \d+ lines"),
    Step("study analyse", r"palpation", ("trial/analysis/report.html",)),
    Step("study repeatability", r"repeatability", ("trial-repeatability/*",)),
    Step("study card", r"as they were written", ("trial-card/report.pdf",)),
    Step("study check", r"EWMA", ("checks-chart/report.pdf",)),
    Step("study size", r"Research use only"),
    Step("study kit", r"Begin with kit\.pdf", ("kit/kit.pdf", "kit/sphere-10.stl", "kit/modulus.csv")),
    Step("study score", r"Moduli of the bench", ("trial-score/report.pdf",)),
    Step("study plan", r"presses +40", ("plan/result.json",)),
    Step("sweep example", r"", ("plan.toml",)),
    Step("sweep run", r"1024 presses in 16 files", ("data/part-000015.parquet", "data/manifest.json")),
    Step("sweep verify", r"1024 presses in 16 files are as they were written"),
)
NOT_HERE = {
    "calibrate": "needs a camera and a force gauge; its default command is `calibrate guide`, which is walked",
}


def examples() -> dict[str, str]:
    """The example of each command, and of each group that has one of its own."""
    parser = typer.main.get_command(app)
    helps = {" ".join(words): command.help for words, command in parsers().items()}
    helps |= {name: command.help for name, command in parser.commands.items()}  # type: ignore[attr-defined]
    lines = {command: text.partition("\n\n")[0] for command, text in helps.items()}
    return {command: line.removeprefix("Example: ") for command, line in lines.items() if line.startswith("Example: ")}


def prepare(folder: Path) -> None:
    """What a newcomer has before: point files, hand-written values of a calibration, a store with known phantoms."""
    rng = np.random.default_rng(1)
    before = rng.uniform(0.0, 10.0, (30, 2))
    after = before @ np.array([[0.98, 0.17], [-0.17, 0.98]]) + 0.5
    for name, points in (("before.csv", before), ("after.csv", after)):
        np.savetxt(folder / name, points, delimiter=",")
    travel = np.linspace(-0.3, 0.3, 300)  # of a ball on a block of 20 kPa, by Hertz's law
    force = 4 / 3 * 20e-3 / 0.75 * np.sqrt(3.0) * np.maximum(travel, 0.0) ** 1.5 + rng.normal(0.0, 2e-5, 300)
    np.savetxt(
        folder / "press.csv", np.c_[travel, force], delimiter=",", header="travel_mm,force_n", comments="", fmt="%.7f"
    )
    vertices = "".join(f"{x} {y} 0\n" for x, y in after)
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    (folder / "after.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex {len(after)}\n{properties}end_header\n{vertices}", encoding="utf-8"
    )
    points = "".join(f"random-1;random-2;random-3,1,compression,20,15,{2 * x},{x}\n" for x in np.linspace(0.1, 1.0, 9))
    (folder / "bench").mkdir()
    (folder / "bench" / "modulus.csv").write_text(f"{','.join(MODULUS_COLUMNS)}\n{points}", encoding="utf-8")
    response = {"gain_grey_per_kpa": 60.0, "saturation_kpa": 20.0, "probe": "tsis-2011"}
    values = {"name": "bench probe 2", "probe": "tsis-2011", "response": response}
    (folder / "values.json").write_text(json.dumps(values), encoding="utf-8")
    with open_store(folder / "lab-records") as store:
        for number in range(1, 27):  # 8 without an inclusion, 8 softer and 8 stiffer than 60 kPa, 2 unknown
            young_kpa = 45.0 if number in (*range(9, 17), 25) else 100.0
            inclusion = Inclusion(diameter_mm=8.0, depth_mm=5.0, young_kpa=young_kpa)
            enter(store, number, inclusion if number > 8 else None, known=number < 25)


def surroundings(folder: Path) -> Mapping[str, str]:
    """The environment of the walk: records and console of its own, the tables of the tests, no browser."""
    return {
        **os.environ,
        "TSIS_RECORDS_DIR": str(folder / "records"),
        "TSIS_CONSOLE_DIR": str(folder / "user"),
        "BROWSER": "true",
        "COLUMNS": "200",
        "PYTHONUNBUFFERED": "1",
    }


def command_line(example: str, program: str = PROGRAM) -> tuple[list[str], str]:
    """The program with the example's arguments, and the file that its output goes to, if it names one."""
    typed, _, file = example.partition(" > ")
    return [sys.executable, "-c", program, *shlex.split(typed)[1:]], file
