"""Every kind of DICOM export judged by dciodvfy, and through Orthanc and back by four routes.

Run ``python -m benchmarks.dicom_round_trip``; it needs the programs of Debian's dicom3tools, dcmtk, orthanc and
orthanc-dicomweb, and starts its own archive on the loopback interface. The exit code is 2 where they are not there.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
from dicomweb_client.api import DICOMwebClient
from tests.records.dicom.variants import variants
from tests.system.orthanc_peer import AE, LOOPBACK, Archive, free_port, installed, listening, missing, orthanc

from tsis.records.dicom import c_store, dicom_files, stow_rs, write_dicom

if TYPE_CHECKING:
    from collections.abc import Iterable

    from tsis.records import TargetRecord
    from tsis.records.dicom import DicomFile

PROGRAMS = ("dciodvfy", "getscu", "storescp")


def judged(dossiers: Iterable[TargetRecord], folder: Path) -> tuple[int, Counter[str]]:
    """Number of instances that dciodvfy saw, and what it said, without the place that it said it of."""
    instances, said = 0, Counter[str]()
    for number, record in enumerate(dossiers):
        for identified in (False, True):
            for path in write_dicom(record, folder / f"{number}-{identified}", identified=identified):
                instances += 1
                run = subprocess.run(["dciodvfy", str(path)], capture_output=True, text=True, check=False)
                said.update(line for line in run.stderr.splitlines() if line.startswith(("Error", "Warning")))
    return instances, said


def by_own_interface(archive: Archive, files: tuple[DicomFile, ...], _: Path) -> Iterable[Any]:
    c_store(files, host=LOOPBACK, port=archive.dicom_port, called_ae=AE)
    expected = {file.sop_instance_uid for file in files}
    every = (pydicom.dcmread(BytesIO(archive.file(identity))) for identity in archive.instances())
    return [each for each in every if each.SOPInstanceUID in expected]


def by_web(archive: Archive, files: tuple[DicomFile, ...], _: Path) -> Iterable[Any]:
    stow_rs(files, url=archive.web)
    found: Iterable[Any] = DICOMwebClient(archive.web).retrieve_study(files[0].dataset().StudyInstanceUID)
    return found


def by_c_get(archive: Archive, files: tuple[DicomFile, ...], folder: Path) -> Iterable[Any]:
    c_store(files, host=LOOPBACK, port=archive.dicom_port, called_ae=AE)
    study = files[0].dataset().StudyInstanceUID
    keys = ["-S", "-k", "0008,0052=STUDY", "-k", f"0020,000D={study}"]
    where = ["-aec", AE, LOOPBACK, str(archive.dicom_port)]
    subprocess.run(
        [installed("getscu") or "getscu", "+B", "-od", folder, *keys, *where], check=True, capture_output=True
    )
    return [pydicom.dcmread(path) for path in folder.iterdir()]


def by_storescp(_: Archive, files: tuple[DicomFile, ...], folder: Path) -> Iterable[Any]:
    port, received = free_port(), folder / "received"
    received.mkdir()
    command = [installed("storescp") or "storescp", "-aet", "DCMTK", "+B", "-od", str(received), str(port)]
    with listening(command, folder / "log", port):
        c_store(files, host=LOOPBACK, port=port, called_ae="DCMTK")
    return [pydicom.dcmread(path) for path in received.iterdir()]


ROUTES = {
    "C-STORE to Orthanc, back by its REST interface": by_own_interface,
    "STOW-RS to Orthanc, back by WADO-RS": by_web,
    "C-STORE to Orthanc, back by C-GET of dcmtk": by_c_get,
    "C-STORE to dcmtk's storescp": by_storescp,
}


def same(dossier: TargetRecord, files: tuple[DicomFile, ...], back: Iterable[Any]) -> tuple[int, int]:
    """Number of frames that came back pixel for pixel, and of instances of which every element did."""
    found = {each.SOPInstanceUID: each for each in back}
    whole = sum(found.get(file.sop_instance_uid) == file.dataset() for file in files)
    came = [found[file.sop_instance_uid] for file in files if file.sop_instance_uid in found]
    frames = [
        frame
        for each in came
        if "PixelData" in each
        for frame in np.reshape(each.pixel_array, (-1, each.Rows, each.Columns))
    ]
    left = [dossier.levels(press) for press in dossier.presses]
    equal = 0
    for frame in frames:
        place = next((i for i, expected in enumerate(left) if np.array_equal(frame, expected)), None)
        if place is not None and left.pop(place).dtype == frame.dtype:
            equal += 1
    return equal, whole


def main() -> None:
    """Print how many exports were judged and came back, and what was said of them."""
    absent = [name for name in PROGRAMS if installed(name) is None]
    if reason := missing() or (f"{', '.join(absent)}: absent; apt install dicom3tools dcmtk" if absent else ""):
        print(reason, file=sys.stderr)
        raise SystemExit(2)
    kinds = [replace(each, target=replace(each.target, id=name)) for name, each in variants()]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        instances, said = judged(kinds, folder / "judged")
        errors = sum(count for line, count in said.items() if line.startswith("Error"))
        print(
            f"{len(kinds)} kinds of dossiers, each identified and not: {2 * len(kinds)} exports, {instances} instances"
        )
        print(f"dciodvfy: {errors} errors; kinds of warnings:")
        for line, count in said.most_common():
            print(f"  {count:5d}  {line}")
        (folder / "archive").mkdir()
        with orthanc(folder / "archive") as archive:
            for route, (title, call) in enumerate(ROUTES.items()):
                frames = wanted_frames = whole = expected = 0
                started = perf_counter()
                for number, record in enumerate(kinds):
                    own = folder / f"route-{route}-{number}"
                    own.mkdir()
                    files = dicom_files(record)
                    equal, complete = same(record, files, call(archive, files, own))
                    frames, whole = frames + equal, whole + complete
                    wanted_frames, expected = wanted_frames + len(record.presses), expected + len(files)
                took = perf_counter() - started
                print(f"{title}:")
                print(f"  {frames} of {wanted_frames} frames pixel for pixel, ", end="")
                print(f"{whole} of {expected} instances equal in every element, {took:.1f} s")


if __name__ == "__main__":
    main()
