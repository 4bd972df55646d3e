"""Every kind of export and a map, judged by dicom3tools and read by dcmtk."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import pytest
from tests.present.test_lump_map import map_of
from tests.records.sample import sample_record
from tests.records.variants import hardness, variants, with_estimate, with_presses

from tsis.records.dicom import write_dicom
from tsis.records.map_dicom import map_dicom_files

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.records.values import TargetRecord

pytestmark = pytest.mark.system
PLAIN = sample_record()
KINDS = {
    **dict(variants()),
    "two probes": replace(PLAIN, presses=(replace(PLAIN.presses[0], probe="tsis-domed"), *PLAIN.presses[1:])),
    "from a camera": with_presses(PLAIN, settings={"camera": "DMK 33"}),
    "both kinds of estimate": replace(
        PLAIN, estimates=(*PLAIN.estimates, *with_estimate(PLAIN, hardness(), "hardness").estimates)
    ),
}
# What dciodvfy remarks on, and why it stays.
KNOWN = (
    "needed to build DICOMDIR - Study Date",  # taken out, as PS3.15 asks
    "needed to build DICOMDIR - Study Time",
    "is only permitted to be empty when actually unknown",  # the side of the body, which nobody told us
    "Unrecognized defined term <99TSIS>",  # our own codes, named in the report as the standard asks
    "Unrecognized defined term <QUANTITY>",  # of a Parametric Map, as highdicom writes it
)


def program(name: str, package: str) -> str:
    found = shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is absent; apt install {package}")
    return found


def remarks(path: Path) -> list[str]:
    run = subprocess.run(
        [program("dciodvfy", "dicom3tools"), str(path)], capture_output=True, text=True, errors="replace", check=False
    )
    judged = ("Image", "ComprehensiveSR", "ParametricMap", "Segmentation")
    assert any(kind in run.stdout + run.stderr for kind in judged)  # it knows what it judges
    return [line for line in (run.stdout + run.stderr).splitlines() if line.startswith(("Error", "Warning"))]


@pytest.mark.parametrize("identified", [False, True], ids=["de-identified", "identified"])
@pytest.mark.parametrize("kind", KINDS)
def test_dciodvfy_finds_no_error(kind: str, identified: bool, tmp_path: Path) -> None:
    record: TargetRecord = KINDS[kind]
    for path in write_dicom(record, tmp_path, identified=identified):
        said = remarks(path)
        assert [line for line in said if not any(known in line for known in KNOWN)] == [], path.name


def test_dciodvfy_finds_no_error_in_a_map(tmp_path: Path) -> None:
    for file in map_dicom_files(map_of(51).numbers):
        path = tmp_path / file.name
        path.write_bytes(file.content)
        assert [line for line in remarks(path) if not any(known in line for known in KNOWN)] == [], file.name


def test_the_judge_finds_a_wrong_file(tmp_path: Path) -> None:
    import pydicom

    path = write_dicom(sample_record(), tmp_path)[0]
    dataset = pydicom.dcmread(path)
    del dataset.ConversionType
    dataset.save_as(path)
    assert any("Error" in line and "Conversion" in line for line in remarks(path))


def test_dcmtk_reads_the_report(tmp_path: Path) -> None:
    path = next(each for each in write_dicom(sample_record(), tmp_path) if "report" in each.name)
    tool = program("dsrdump", "dcmtk")
    shown = subprocess.run([tool, "+Pl", str(path)], capture_output=True, text=True, check=True).stdout
    assert 'contains NUM:(,,"Diameter")="9.75771" (mm,UCUM,"millimeter")' in shown
    assert '"Compression Force")="0.7" (N,UCUM,"newton")' in shown
    assert "Research use only." in shown
    page = subprocess.run([program("dsr2html", "dcmtk"), str(path)], capture_output=True, text=True, check=True).stdout
    assert "9.75771" in page


def test_dcmtk_reads_the_frames(tmp_path: Path) -> None:
    path = write_dicom(sample_record(full_scale=4095.0), tmp_path)[0]
    said = subprocess.run([program("dcm2xml", "dcmtk"), str(path)], capture_output=True, check=True).stdout
    root = ElementTree.fromstring(said)
    found = {each.get("name"): each.text for each in root.iter("element")}
    assert (found["NumberOfFrames"], found["Rows"], found["Columns"]) == ("2", "96", "150")
    assert (found["PixelSpacing"], found["FrameTimeVector"], found["BitsStored"]) == ("0.14\\0.12", "0\\20000", "12")
    subprocess.run([program("dcmdump", "dcmtk"), str(path)], capture_output=True, check=True)
