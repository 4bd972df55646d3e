"""What the command line says to bad input: one sentence each, and how long that takes.

    python -m tests.cli.bad_inputs [--markdown]

Every case runs in this process on files that are made for it. A case is wrong when the program ends with a traceback,
prints no sentence or several, or takes more than a second of processor time, which other work on the machine changes
little. Cases that are served say so.
"""

from __future__ import annotations

import io
import json
import os
import sys
import tempfile
import time
import warnings
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from unittest import mock

import cv2
import numpy as np

import tsis
from tsis.calibration.file import ProbeCalibration, calibration_bytes
from tsis.cli import main as main_of_tsis
from tsis.imaging.sensor import Sensor
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

LONGEST_S = 1.0
SENTENCE = 600  # characters


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What came of a case."""

    name: str
    code: int
    said: str
    seconds: float

    @property
    def faults(self) -> list[str]:
        """Why it is wrong; empty where it is right."""
        found = []
        if self.code not in (0, 1, 2, 3):
            found.append(f"exit code {self.code}")
        if self.code and not self.said:
            found.append("no sentence")
        if "a defect of tsis" in self.said or "Traceback" in self.said:
            found.append("a defect")
        if len(self.said) > SENTENCE:
            found.append("a long message")
        if self.seconds > LONGEST_S:
            found.append("slow")
        return found


def png(folder: Path, name: str, grey: np.ndarray) -> None:
    """Write a picture."""
    cv2.imwrite(str(folder / name), grey)


def made(folder: Path) -> None:
    """Files of all cases."""
    rng = np.random.default_rng(1)
    frame = rng.integers(5, 12, (492, 768)).astype(np.uint8)
    y, x = np.mgrid[:492, :768]
    light = (90 * np.exp(-((x - 384) ** 2 + (y - 246) ** 2) / 2e4)).astype(np.uint8)
    png(folder, "untouched.png", frame)
    png(folder, "press.png", frame + light)
    png(folder, "firm.png", frame + light + light // 2)
    png(folder, "small.png", (frame + light)[:300, :400])
    png(folder, "one.png", frame[:1, :1])
    png(folder, "rgba.png", np.dstack([frame + light, frame, frame, np.full_like(frame, 128)]))
    png(folder, "deep.png", (frame + light).astype(np.uint16) * 257)
    whole = (folder / "press.png").read_bytes()
    (folder / "claimed.png").write_bytes(whole[:16] + (32768).to_bytes(4) * 2 + whole[24:])
    (folder / "cut.png").write_bytes(whole[: len(whole) // 2])
    (folder / "empty.png").write_bytes(b"")
    (folder / "text.png").write_text("not a picture")
    (folder / "folder.png").mkdir()
    (folder / "dead.png").symlink_to(folder / "nowhere.png")
    (folder / os.fsdecode(b"caf\xe9.png")).write_bytes(whole)
    for name, probe in (("calibration.json", "tsis-domed"), ("other.json", "tsis-2011")):
        known = nominal_calibration(Sensor(), tsis.model.calibration.LightMap.uniform())
        (folder / name).write_bytes(calibration_bytes(ProbeCalibration(name="bench", probe=probe, response=known)))
    document = json.loads((folder / "calibration.json").read_text())
    (folder / "future.json").write_text(json.dumps(document | {"version": 99}))
    (folder / "older.json").write_text(json.dumps(document | {"version": document["version"] - 1}))
    (folder / "changed.json").write_text((folder / "calibration.json").read_text().replace("bench", "beach"))
    (folder / "wrong.toml").write_text("diameter_mm = [5.0, 2.0]\n")


EXAMINE = ("examine", "press.png")
KNOWN = ("--calibration", "calibration.json", "--scale-mm", "0.0336,0.0392")
BOTH = ("examine", "press.png", "firm.png", *KNOWN)
CASES: dict[str, tuple[str, ...]] = {
    **{f"force {value}": (*EXAMINE, *KNOWN, "--force-n", value) for value in ("nan", "inf", "-1", "0", "1e30", "soft")},
    "force in mN": (*EXAMINE, *KNOWN, "--force-n", "500"),
    "depth in m": ("simulate", "--depth-mm", "0.005"),
    "diameter in m": ("simulate", "--diameter-mm", "0.01"),
    "modulus in Pa": ("simulate", "--young-kpa", "100000000"),
    "scale in m": ("contacts", "press.png", "--scale-mm", "0.0000336"),
    "scale negative": ("contacts", "press.png", "--scale-mm", "-0.03"),
    "empty file": ("contacts", "empty.png"),
    "text for a picture": ("contacts", "text.png"),
    "cut picture": ("contacts", "cut.png"),
    "claimed 1 GB": ("contacts", "claimed.png"),
    "one pixel": ("contacts", "one.png"),
    "RGBA": ("contacts", "rgba.png"),
    "16 bits": ("contacts", "deep.png"),
    "folder for a file": ("contacts", "folder.png"),
    "device file": ("contacts", "/dev/zero"),
    "dead link": ("contacts", "dead.png"),
    "missing file": ("contacts", "nowhere.png"),
    "name of 4,096 bytes": ("contacts", "n" * 4096),
    "name not in UTF-8": ("contacts", os.fsdecode(b"caf\xe9.png")),
    "other size than the reference": ("contacts", "small.png", "--reference", "untouched.png"),
    "mixed sizes": ("examine", "press.png", "small.png", *KNOWN, "--force-n", "0.5", "--force-n", "1"),
    "same frame twice": ("examine", "press.png", "press.png", *KNOWN, "--force-n", "0.5", "--force-n", "1"),
    "two presses, one force": (*BOTH, "--force-n", "1"),
    "swapped reference and target": ("contacts", "untouched.png", "--reference", "press.png"),
    "press brighter than its force": (*EXAMINE, *KNOWN, "--force-n", "1", "--probe", "tsis-domed"),
    "force below the whole dome's": (*EXAMINE, *KNOWN, "--force-n", "0.1"),
    "force beyond the table": (*EXAMINE, *KNOWN, "--force-n", "5"),
    "tissue outside the tables": ("protocol", "--tissue-kpa", "500"),
    "calibration of another probe": (
        *EXAMINE,
        "--calibration",
        "other.json",
        *KNOWN[2:],
        "--probe",
        "tsis-domed",
        "--force-n",
        "1",
    ),
    "calibration of an older version": (*EXAMINE, "--calibration", "older.json", "--force-n", "1"),
    "wrong probe": (*EXAMINE, *KNOWN, "--force-n", "1", "--probe", "tsis-2011"),
    "misspelt probe": ("simulate", "--probe", "tsis-domd"),
    "calibration of a newer version": (*EXAMINE, "--calibration", "future.json", "--force-n", "1"),
    "changed calibration": (*EXAMINE, "--calibration", "changed.json", "--force-n", "1"),
    "calibration that is a picture": (*EXAMINE, "--calibration", "press.png", "--force-n", "1"),
    "prior the wrong way round": (*EXAMINE, *KNOWN, "--force-n", "1", "--prior", "wrong.toml"),
    "folder without frames": ("examine", ".", "--calibration", "calibration.json"),
    "frame without a calibration": EXAMINE,
    "option of a gel sensor": ("contacts", "press.png", "--csv", "c.csv"),
    "misspelt command": ("examin", "press.png"),
    "misspelt option": ("examine", "press.png", "--forc-n", "1"),
    "time in the past": ("records", "import", "press.png", "--taken", "1066-10-14T09:00:00Z", "--store", "store"),
    "store that is a file": ("records", "list", "--store", "press.png"),
    "study that is none": ("study", "show", "folder.png"),
    "more than fits": ("simulate", "--depth-mm", "25"),
}


def answered(name: str, words: Sequence[str]) -> Answer:
    """Run one case in the present folder."""
    out, error, code = io.StringIO(), io.StringIO(), 0
    began = time.process_time()
    with (
        mock.patch.object(sys, "argv", ["tsis", *words]),
        warnings.catch_warnings(),
        redirect_stdout(out),
        redirect_stderr(error),
    ):
        try:
            main_of_tsis()
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else 1
    seconds = time.process_time() - began
    lines = error.getvalue().splitlines() if code else [one for one in out.getvalue().splitlines() if one[:2] == "- "]
    said = " ".join(" ".join(lines).split())
    return Answer(name=name, code=code, said=said if code else said[:SENTENCE], seconds=seconds)


def answers(names: Sequence[str] = tuple(CASES), *, each: Callable[[str], None] = lambda _: None) -> list[Answer]:
    """All cases, after one that loads the libraries."""
    found = []
    with tempfile.TemporaryDirectory(prefix="tsis-bad-") as folder, chdir(folder):
        made(Path(folder))
        answered("warm", ("contacts", "press.png", "--reference", "untouched.png"))
        for name in names:
            each(name)
            found.append(answered(name, CASES[name]))
    return found
