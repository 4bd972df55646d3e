"""What the plain install and each extra bring: packages, megabytes, seconds to install and to a first result.

Each is installed from a wheel of this repository into an environment of its own. Prints a table, row by row.

    python -m release.extras [EXTRA ...]
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLAIN = ""
FIRST = {  # code or command that uses the extra
    PLAIN: ["demo", "--json", "--out", "first-press"],
    "analysis": (
        "import h5netcdf, zarr, numpy, pandas, tsis; result = tsis.Estimate(samples={'depth_mm': numpy.arange(9.0)}, "
        "prior_sd={'depth_mm': 1.0}); result.to_arviz(); tsis.TactileImage(grey=numpy.eye(8)).to_xarray()"
    ),
    "camera": "import tsis.instrument.drivers.opencv; import cv2; cv2.VideoCapture()",
    "camera-aravis": "from tsis.instrument.discovery import find_cameras; find_cameras(['aravis'])",
    "camera-genicam": "import harvesters.core, genicam.gentl; import tsis.instrument.drivers.genicam",
    "camera-pylon": (
        "from tsis.instrument.discovery import find_cameras; assert 'pylon' not in find_cameras(['pylon']).missing"
    ),
    "cluster": ["sweep", "run", "plan.toml", "--out", "data"],
    "console": "import tsis.console.pages, tsis.console.api, tsis.records, tsis.present.pdf",
    "dicom": "import tsis.records.dicom, tsis.records.map_dicom; import highdicom, pydicom",
    "fem3d": "import tsis.mechanics.solid; import ngsolve, netgen.occ",
    "map": "import tsis.present.lump_map; import nibabel",
    "postgres": "import tsis.records.store; import psycopg; assert psycopg.pq.__impl__ == 'binary'",
    "records": ["demo", "--save", "--store", "store", "--out", "saved-press"],
    "report": "from tsis.present.pdf import pdf",
    "study": "import tsis.study.estimator; import statsmodels.genmod.generalized_linear_model",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtraCost:
    """Cost of an extra, with the plain install: the number of packages, MB on disk, and seconds."""

    extra: str
    packages: int
    megabytes: float
    install_s: float
    first_s: float

    def row(self) -> str:
        """Row of a table in Markdown."""
        name = f"`{self.extra}`" if self.extra else "plain"
        return f"| {name} | {self.packages} | {self.megabytes:.0f} | {self.install_s:.0f} | {self.first_s:.1f} |"


def extras() -> list[str]:
    """The extras of the project, by name."""
    manifest = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return sorted(set(manifest["project"]["optional-dependencies"]) - {"all"})


def built_wheel(folder: Path) -> Path:
    """A wheel of this repository."""
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = folder.glob("tsis-*.whl")
    return wheel


def installed(wheel: Path, extra: str, folder: Path, *, python: str = sys.executable) -> Path:
    """The programs of a new environment with the wheel and the extra in it, at the pinned versions."""
    subprocess.run([python, "-m", "venv", str(folder)], check=True)
    requirement = f"{wheel}[{extra}]" if extra else str(wheel)
    pinned = ["--constraint", str(ROOT / "constraints.txt")]
    command = [str(folder / "bin" / "python"), "-m", "pip", "install", "--quiet", *pinned, requirement]
    subprocess.run(command, check=True)
    return folder / "bin"


def cost(wheel: Path, extra: str, folder: Path) -> ExtraCost:
    """Install the extra into ``folder / "environment"`` and use it; `subprocess.CalledProcessError` where it fails."""
    started = time.monotonic()
    programs = installed(wheel, extra, folder / "environment")
    between = time.monotonic()
    first = FIRST[extra]
    if extra == "cluster":
        example = subprocess.run([programs / "tsis", "sweep", "example"], check=True, capture_output=True)
        (folder / "plan.toml").write_bytes(example.stdout)
    python, tsis = str(programs / "python"), str(programs / "tsis")
    command = [python, "-c", first] if isinstance(first, str) else [tsis, *first]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    ended = time.monotonic()
    site = next((folder / "environment" / "lib").glob("python*/site-packages"))
    own = {"pip", "setuptools"}
    packages = {path.name.partition("-")[0].lower() for path in site.glob("*.dist-info")} - own
    size = sum(
        path.stat().st_size
        for path in site.rglob("*")
        if path.is_file() and path.relative_to(site).parts[0].partition("-")[0] not in own
    )
    return ExtraCost(
        extra=extra,
        packages=len(packages),
        megabytes=size / 1e6,
        install_s=between - started,
        first_s=ended - between,
    )


def main(names: list[str]) -> None:
    """Print the table."""
    print("| extra | packages | MB | seconds to install | seconds to the first result |")
    print("| --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as place:
        wheel = built_wheel(Path(place))
        for extra in names or [PLAIN, *extras()]:
            folder = Path(place) / (extra or "plain")
            folder.mkdir()
            print(cost(wheel, extra, folder).row(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
