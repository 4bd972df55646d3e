"""``dir(tsis)`` lists the public names, and each resolves, with and without the extras."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import tsis

EXTRAS = (
    "arviz cv2 distributed fastapi h5py nicegui ngsolve pandas pyarrow pydicom reportlab sklearn sqlalchemy "
    "statsmodels xarray"
)
NEEDED = {"records": "records", "console": "console"}  # extras without which a package does not load

RUN = """
import sys
for name in sys.argv[2].split():
    sys.modules[name] = None
import tsis
from tsis.errors import MissingExtraError
try:
    print(type(getattr(tsis, sys.argv[1])).__name__)
except MissingExtraError as error:
    print(error)
"""


def packages() -> set[str]:
    folder = Path(tsis.__file__).parent
    found = {path.parent.name for path in folder.glob("*/__init__.py")}
    return found | {path.stem for path in folder.glob("*.py") if not path.stem.startswith("_")}


def test_dir_lists_all_public_names() -> None:
    assert {*dir(tsis), "__version__"} >= set(tsis.__all__)
    assert set(dir(tsis)) >= packages() - {"cli", "compiled"}
    assert all(not name.startswith("_") or name == "__version__" for name in dir(tsis))


@pytest.mark.parametrize("name", dir(tsis))
def test_every_public_name_resolves(name: str) -> None:
    value = getattr(tsis, name)
    if name in packages():
        assert value is importlib.import_module(f"tsis.{name}")
    else:
        assert name in tsis.__all__


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="radius"):
        tsis.radius  # type: ignore[attr-defined]  # noqa: B018
    assert not hasattr(tsis, "radius")


@pytest.mark.system
@pytest.mark.parametrize("name", sorted({*dir(tsis), "sweep"}))
def test_each_name_alone_resolves_in_a_plain_install(name: str) -> None:
    command = [sys.executable, "-W", "error", "-c", RUN, name, EXTRAS]
    finished = subprocess.run(command, capture_output=True, text=True, check=True)
    if name in NEEDED:
        assert finished.stdout.count("\n") == 1
        assert f'python -m pip install "tsis[{NEEDED[name]}]"' in finished.stdout
    else:
        assert finished.stdout.strip() in ("module", "type", "function", "str")
