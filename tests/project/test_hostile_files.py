"""Damaged, forged and malicious files over every loader: one sentence, or the value that was written."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.endurance import scaled
from tests.hostile.bytes_changed import damaged
from tests.hostile.every_loader import BAD, count, every_loader, shared_out
from tests.hostile.loader import Loader
from tests.hostile.verdict import Verdict, judged

from tsis.errors import FileInputError, TsisError

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "src").rglob("*.py"))
OWN_PIPES = {ROOT / "src/tsis/processes.py"}  # to the processes that this program started, never a file


@pytest.fixture(scope="module")
def loaders() -> tuple[Loader, ...]:
    return every_loader()


def judge_files(loaders: tuple[Loader, ...], files: int, *, seed: int) -> None:
    shares = shared_out(files, loaders)
    for place, (loader, share) in enumerate(zip(loaders, shares, strict=True)):
        tally = count(loader, place, range(share), seed=seed)
        assert not any(tally.counts[verdict] for verdict in BAD), (loader.name, tally)
        assert tally.counts.total() == share
        if loader.name != "cached arrays" and share > 20:  # which are computed anew instead
            assert tally.counts[Verdict.REFUSED] > share / 4, loader.name


def test_thousands_of_files_are_refused_in_one_sentence_or_read_as_they_were(loaders: tuple[Loader, ...]) -> None:
    judge_files(loaders, 3000, seed=20)


@pytest.mark.slow
def test_many_more_files_are_refused_in_one_sentence_or_read_as_they_were(loaders: tuple[Loader, ...]) -> None:
    judge_files(loaders, scaled(20_000), seed=2)


def test_what_must_not_happen_would_be_seen(tmp_path: Path) -> None:
    def careless(path: Path) -> Hashable:
        return path.read_bytes()

    def broken(path: Path) -> Hashable:
        raise KeyError(path.name)

    def verbose(path: Path) -> Hashable:
        raise FileInputError("two\nlines")

    path = tmp_path / "a"
    path.write_bytes(b"changed")
    original = b"original"
    for load, integrity, forged, verdict in (
        (careless, True, False, Verdict.SILENT),
        (careless, False, False, Verdict.OTHER),
        (careless, True, True, Verdict.OTHER),
        (broken, True, False, Verdict.UNTYPED),
        (verbose, True, False, Verdict.UNTYPED),
    ):
        loader = Loader(name="a", file="a", originals=(original,), load=load, integrity=integrity)
        assert judged(loader, path, original, forged=forged).verdict is verdict
    path.write_bytes(original)
    loader = Loader(name="a", file="a", originals=(original,), load=careless, integrity=True)
    assert judged(loader, path, original, forged=False).verdict is Verdict.EQUAL


def _python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True)


def test_damage_depends_on_its_seed_alone() -> None:
    whole = bytes(range(256))
    many = [damaged(whole, b"other", np.random.default_rng([1, number]), text=True) for number in range(200)]
    again = [damaged(whole, b"other", np.random.default_rng([1, number]), text=True) for number in range(200)]
    assert many == again
    assert len(set(many)) > 180


@pytest.mark.system
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_bombs_are_refused_with_little_memory() -> None:
    done = _python("-m", "tests.hostile.bombs", "quick")
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_large_bombs_are_refused_with_little_memory() -> None:
    done = _python("-m", "tests.hostile.bombs", "large")
    assert done.returncode == 0, done.stdout


SPECIAL: dict[str, Callable[[Path], None]] = {
    "a pipe": lambda path: os.mkfifo(path),
    "an endless device": lambda path: path.symlink_to("/dev/zero"),
    "a link to itself": lambda path: path.symlink_to(path),
    "nothing": Path.touch,
}


@pytest.mark.filterwarnings("ignore::tsis.errors.RecordsWarning")  # files are laid with the modes of the test
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_no_loader_opens_what_is_no_regular_file(loaders: tuple[Loader, ...], tmp_path: Path) -> None:
    for number, loader in enumerate(loaders):
        if loader.name in ("store, database", "cached arrays"):  # SQLite opens its own; a cache computes anew
            continue
        path = loader.laid(tmp_path / str(number))
        for kind, lay in SPECIAL.items():
            path.unlink(missing_ok=True)
            lay(path)
            with pytest.raises(TsisError) as refused:
                pytest.fail(f"{loader.name} read {kind}: {loader.load(path)!r}")
            assert str(refused.value).isprintable(), loader.name
        path.unlink()
        path.mkdir()
        with pytest.raises(TsisError):
            loader.load(path)


def _calls(tree: ast.AST) -> list[tuple[str, ast.Call]]:
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [(ast.unparse(node.func), node) for node in calls if isinstance(node.func, ast.Name | ast.Attribute)]


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_source_unpickles_a_file_or_runs_what_it_reads(source: Path) -> None:
    tree = ast.parse(source.read_text(encoding="utf-8"))
    imported = {
        name.split(".")[0]
        for node in ast.walk(tree)
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    unsafe = imported & {"pickle", "cPickle", "dill", "cloudpickle", "shelve", "marshal", "joblib", "yaml"}
    assert unsafe <= ({"pickle"} if source in OWN_PIPES else set())
    for name, call in _calls(tree):
        assert name not in {"eval", "exec", "pickle.Unpickler"}, ast.unparse(call)
        if name in {"np.load", "numpy.load", "np.lib.format.read_array"}:
            safe = {keyword.arg: ast.unparse(keyword.value) for keyword in call.keywords}
            assert safe.get("allow_pickle") == "False", ast.unparse(call)
