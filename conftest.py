"""What every test run shares: caches, one profile of hypothesis, and the promise that quick tests start nothing."""

from __future__ import annotations

import gc
import hashlib
import os
import platform
import shutil
import signal
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from _pytest.doctest import DoctestModule
from hypothesis import settings
from threadpoolctl import threadpool_limits

if TYPE_CHECKING:
    from collections.abc import Generator

collect_ignore = ["docs/_build"]
ROOT = Path(__file__).parent
TESTS = ROOT / "tests"
CACHES = Path(sys.prefix)  # the environment's own folder: .venv of `make test`
TABLES = "test-tables"
MEMORY, ROOM_BYTES = Path("/dev/shm"), 4 * 2**30  # Linux' file system in memory, and the room that tests may need
MODELS = ("hardness", "mechanics", "model", "optics")  # packages whose code decides what the tables hold
PAGES_THAT_START = {"run-a-sweep.md"}
STARTS = {"subprocess.Popen", "os.fork", "os.posix_spawn", "socket.bind"}  # audit events of processes and servers

os.environ["NUMBA_CACHE_DIR"] = str(CACHES / "numba-cache")  # before anything imports numba
sys.dont_write_bytecode = False  # a run would compile all its files anew, and so would each program that it starts
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
for _library in ("OPENBLAS", "MKL", "OMP"):  # of libraries that are loaded later, and of workers
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
settings.register_profile("tests", deadline=None, derandomize=True)  # a busy machine is no failure
settings.register_profile("search", deadline=None, max_examples=500)  # pytest --hypothesis-profile search
settings.load_profile("tests")
_quick_test: list[str] = []  # the one that runs now


def pytest_configure(config: pytest.Config) -> None:
    """Choose the folder of tables that are slow to compute: one for each state of the code that computes them."""
    if not hasattr(config, "workerinput"):  # workers inherit the controller's environment
        folder = CACHES / TABLES / _models_hash()
        for other in set((CACHES / TABLES).glob("*")) - {folder}:
            shutil.rmtree(other, ignore_errors=True)
        os.environ["TSIS_CACHE_DIR"] = str(folder)
        if _has_room(MEMORY):
            os.environ.setdefault("TMPDIR", str(MEMORY))  # where synchronising a file waits for no disk
            tempfile.tempdir = None  # pytest's capture has asked for the folder already; ask anew
    threadpool_limits(limits=1, user_api="blas")  # threads slow down matrices this small, the more so in two workers
    gc.set_threshold(20_000, 20, 20)  # looking for garbage after each 700 new objects takes a twentieth of the time
    platform.processor()  # asks a program once and keeps the answer
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # begun in the background, where shells ignore Ctrl-C
        signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.addaudithook(_refuse_starts)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object | None:
    """Give a worker whole files, and one worker all that matches points: each worker would compile the same loops."""
    if config.getoption("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):  # type: ignore[misc]
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return "matching" if "match" in file else str(file)

    return Scheduling(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect no garbage meanwhile: a third of the time would go into looking for it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path: Path) -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
    """Look for no examples in the files of tests, which have none."""
    found = yield
    return found if TESTS not in file_path.parents else [one for one in found if not isinstance(one, DoctestModule)]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the pages whose examples start processes."""
    for item in items:
        if item.path.name in PAGES_THAT_START:
            item.add_marker("system")


def pytest_collection_finish() -> None:
    """Exempt what was loaded from garbage collection: looking through it stops a worker for half a second."""
    gc.freeze()


@pytest.fixture(autouse=True)
def _quick(request: pytest.FixtureRequest) -> Generator[None, None, None]:
    """Name the running test where it must start no process and open no port."""
    if any(map(request.node.get_closest_marker, ("system", "slow", "release"))):
        yield
        return
    _quick_test.append(request.node.nodeid)
    yield
    _quick_test.clear()


def _refuse_starts(event: str, arguments: tuple[Any, ...]) -> None:
    if _quick_test and event in STARTS and os.getpid() == _OWN:
        raise RuntimeError(f"{_quick_test[0]} must be marked `system`: it calls {event} with {arguments!r:.200}")


def _has_room(folder: Path) -> bool:
    """Whether temporary files can lie in a folder, those that release tests install and run among them."""
    if not (folder.is_dir() and os.access(folder, os.W_OK)):
        return False
    system = os.statvfs(folder)
    return not system.f_flag & os.ST_NOEXEC and system.f_bavail * system.f_frsize >= ROOM_BYTES


def _models_hash() -> str:
    sources = [
        path for model in MODELS for path in sorted((ROOT / "src" / "tsis" / model).rglob("*")) if path.is_file()
    ]
    contents = (path.read_bytes() for path in sources if path.suffix in (".py", ".toml"))
    return hashlib.sha256(b"".join(contents)).hexdigest()[:16]


_OWN = os.getpid()
