"""The example of every command, typed one after the other in one folder."""

from __future__ import annotations

import re
import signal
import subprocess
import urllib.request
from typing import TYPE_CHECKING

import pytest
from tests.cli.example_walk import NOT_HERE, WALK, Step, command_line, examples, prepare, surroundings

if TYPE_CHECKING:
    from pathlib import Path

EXAMPLES = examples()


def test_every_example_is_walked_once_or_says_why_not() -> None:
    walked = [step.command for step in WALK]
    assert sorted([*walked, *NOT_HERE]) == sorted(EXAMPLES)
    assert len(NOT_HERE) <= 2


@pytest.mark.slow
@pytest.mark.parametrize("walk", [pytest.param(WALK, id=f"{len(WALK)} commands")])
def test_a_newcomer_can_type_every_example(walk: tuple[Step, ...], tmp_path: Path) -> None:
    prepare(tmp_path)
    for step in walk:
        type_example(step, EXAMPLES[step.command], tmp_path)


def type_example(step: Step, example: str, folder: Path) -> None:
    """Type an example; it ends well, prints and writes what it names."""
    command, file = command_line(example)
    with subprocess.Popen(
        command,
        cwd=folder,
        env=surroundings(folder),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            before = end_when_it_serves(process, step.serves) if step.serves else ""
            out, err = process.communicate(step.typed or None)
        finally:
            process.kill()
    out = before + out
    assert process.returncode == 0, f"{example}\n{out}\n{err}"
    assert "Traceback" not in err, f"{example}\n{err}"
    if file:
        (folder / file).write_text(out, encoding="utf-8")
    assert re.search(step.prints, out), f"{example}\n{out}\n{err}"
    for pattern in step.writes:
        written = [path for path in folder.glob(pattern) if path.is_file()]
        assert written, f"{example} wrote no {pattern}\n{out}"
        assert all(path.stat().st_size for path in written), f"{example} wrote an empty {pattern}"


def end_when_it_serves(process: subprocess.Popen[str], start: str) -> str:
    """Ctrl-C after the line with that start, and after a page where the line names one; what was printed before."""
    assert process.stdout is not None
    lines = []
    for line in process.stdout:
        lines.append(line)
        if line.startswith(start):
            address = line.removeprefix(start).strip()
            if address.startswith("http://"):
                visitor = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
                with visitor.open(address) as page:
                    assert b"<html" in page.read()
            break
    process.send_signal(signal.SIGINT)
    return "".join(lines)
