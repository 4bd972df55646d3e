"""``python -m tests.records.full_disk_exports FOLDER``: exports for which there is no room, told as JSON.

Without a second argument the disk itself is too small; with ``limit`` no file may be larger than a part of what it
needs, down to nothing.
"""

from __future__ import annotations

import json
import resource
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.records.variants import framed, noise

from tsis.errors import TsisError
from tsis.records.arrays import write_netcdf, write_zarr
from tsis.records.dicom import write_dicom
from tsis.records.export import write_csv
from tsis.records.target import write_bundle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

WRITERS: dict[str, Callable[..., Any]] = {
    "netcdf": write_netcdf,
    "zarr": write_zarr,
    "csv": write_csv,
    "bundle": write_bundle,
    "bundle.zip": write_bundle,
    "dicom": write_dicom,
}
PARTS = 12  # of the largest file, which fail at the first byte, at the last, and between


def main(folder: Path, *, limit: bool) -> None:
    """Write frames that no gzip makes smaller in each form, and tell what was said and what is left."""
    record = framed([noise(300, 400, seed=seed) for seed in range(8)])
    found: list[dict[str, Any]] = []
    for name, write in WRITERS.items():
        most = 0
        if limit:
            write(record, folder / "whole" / name)
            written = folder / "whole" / name
            files = [written] if written.is_file() else [path for path in written.rglob("*") if path.is_file()]
            most = max(path.stat().st_size for path in files)
        for part in range(PARTS if limit else 1):
            result = {"form": name, "said": "", "error": ""}
            with _limited(most * part // PARTS if limit else None):
                try:
                    write(record, folder / name)
                except TsisError as error:
                    result |= {"said": str(error), "error": type(error).__name__}
            found.append({**result, "left": [path.name for path in folder.iterdir() if path.name != "whole"]})
    sys.stdout.write(json.dumps(found))


@contextmanager
def _limited(most: int | None) -> Iterator[None]:
    """No file may grow beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    if most is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


if __name__ == "__main__":
    main(Path(sys.argv[1]), limit=sys.argv[2:] == ["limit"])
