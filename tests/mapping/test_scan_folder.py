"""A scan read from a folder or a table."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.calibration.file import ProbeCalibration
from tsis.calibration.frames import UsableCalibration
from tsis.errors import TsisError
from tsis.files.result_folder import write_folder
from tsis.imaging.sensor import Sensor
from tsis.mapping.scan import Indenter, Scan, ScanPress
from tsis.mapping.scan_folder import calibrated, loading_part, read_scan, scan_files
from tsis.model.calibration import LightMap
from tsis.model.image import TactileImage
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


BALL = Indenter(shape="ball", radius_mm=1.6)


def scan_of(rng: np.random.Generator) -> Scan:
    presses = tuple(
        ScanPress(
            place_mm=(10.0 * number, -3.25),
            place_sd_mm=0.5,
            angle_deg=30.0 * number,
            force_n=1.0 + 0.1 * number,
            pressure_kpa=rng.normal(2.0, 0.1, size=(12, 24)),
            reference=number == 2,
            name=f"press {number}",
        )
        for number in range(3)
    )
    return Scan(presses=presses, name="one")


def test_a_written_scan_is_read_bit_for_bit(tmp_path: Path) -> None:
    made = scan_of(np.random.default_rng(7))
    read = read_scan(write_folder(tmp_path / "one", scan_files(made, probe="tsis-2011")))
    assert read.probe == "tsis-2011"
    assert read.scan.left_out == ()
    for was, now in zip(made.presses, read.scan.presses, strict=True):
        for name in ("place_mm", "place_sd_mm", "angle_deg", "force_n", "reference", "name"):
            assert getattr(was, name) == getattr(now, name)
        np.testing.assert_array_equal(np.asarray(was.pressure_kpa), np.asarray(now.pressure_kpa))


def test_a_press_without_place_is_named_and_left_out(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "one", scan_files(scan_of(np.random.default_rng(8))))
    poses = folder / "poses.csv"
    lines = poses.read_text().splitlines()
    cells = lines[2].split(",")
    cells[1] = ""
    poses.write_text("\n".join([lines[0], lines[1], ",".join(cells), lines[3]]))
    read = read_scan(folder)
    assert read.scan.left_out == ("press 1 has no place.",)
    assert [press.name for press in read.scan.presses] == ["press 0", "press 2"]


def test_a_table_of_an_indenter_gives_one_press_a_name(tmp_path: Path) -> None:
    table = tmp_path / "robot.csv"
    table.write_text(
        "press,x_mm,y_mm,travel_mm,force_n\na,0,0,0,0\na,0,0,1,0.2\nb,5,0,0,0\nb,5,0,1,0.3\nc,,,0,0\nc,,,1,0.1\n"
    )
    read = read_scan(table, indenter=BALL)
    assert [press.place_mm for press in read.scan.presses] == [(0.0, 0.0), (5.0, 0.0)]
    np.testing.assert_array_equal(np.asarray(read.scan.presses[1].travel_force), [[0, 0], [1, 0.3]])
    assert read.scan.left_out == ("press c has no place.",)


def test_a_robots_table_of_downward_travel_and_negative_force_gives_the_way_in(tmp_path: Path) -> None:
    """Rows at one place are one press; pauses and the way back are left out; other columns do not matter."""
    table = tmp_path / "robot.csv"
    head = "t [s];x [mm];y [mm];z [m];Fx [N];Fz [N]\n"
    way = [(-0.001, 0.0), (-0.002, -0.1), (-0.002, -0.1), (-0.003, -0.5), (-0.002, -0.05)]
    rows = [f"0,1;{x};0;{z};9;{force}\n".replace(".", ",") for x in (0, 5) for z, force in way]
    table.write_text(head + "".join(rows))
    presses = read_scan(table, indenter=BALL).scan.presses
    assert [press.place_mm for press in presses] == [(0.0, 0.0), (5.0, 0.0)]
    np.testing.assert_allclose(np.asarray(presses[1].travel_force), np.array([[1.0, 0.0], [2.0, 0.1], [3.0, 0.5]]))


PRESS = [(0.0, 0.0), (1.0, 0.1), (2.0, 0.4)]  # travel and force on the way in


def written(table: Path, rows: Sequence[tuple[object, ...]], heads: str = "x_mm,y_mm,travel_mm,force_n") -> Path:
    table.write_text("\n".join([heads, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return table


def test_a_place_pressed_again_is_another_press(tmp_path: Path) -> None:
    """At once after a way back, or on a second round over all places, or with the way in alone."""
    way = [*PRESS, (1.0, 0.05), (0.0, 0.0)]
    again = [(travel, 2 * force) for travel, force in way]
    at_once = [(x, 0, *row) for x in (0, 5) for row in (*way, *again)]
    rounds = [(x, 0, *row) for visit in (way, again) for x in (0, 5) for row in visit]
    way_in = [(x, 0, travel, visit * force) for visit in (1, 2) for x in (0, 5) for travel, force in PRESS]
    for rows in (at_once, rounds, way_in):
        presses = read_scan(written(tmp_path / "robot.csv", rows), indenter=BALL).scan.presses
        assert [press.name for press in presses] == ["0, 0", "0, 0 (2)", "5, 0", "5, 0 (2)"]
        last = [np.asarray(press.travel_force)[-1].tolist() for press in presses]
        assert last == [[2.0, 0.4], [2.0, 0.8], [2.0, 0.4], [2.0, 0.8]]


def test_rows_sorted_by_travel_or_with_places_that_tremble_are_one_press_a_place(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    by_travel = [(x, 0, *row) for row in PRESS for x in (0, 5)]
    trembling = [(x + rng.normal(0, 0.02), rng.normal(0, 0.02), *row) for x in (0, 5) for row in PRESS]
    between = [*trembling[:3], (2.4, 0, -3.0, 0.0), *trembling[3:]]
    for rows, left_out in ((by_travel, ()), (trembling, ()), (between, ("Rows that are alone at their place: 1.",))):
        scan = read_scan(written(tmp_path / "robot.csv", rows), indenter=BALL).scan
        np.testing.assert_allclose(scan.places_mm, [[0, 0], [5, 0]], atol=0.1)
        assert all(np.array_equal(np.asarray(press.travel_force), PRESS) for press in scan.presses)
        assert scan.left_out == left_out


def test_numbers_that_begin_anew_on_each_line_are_refused(tmp_path: Path) -> None:
    heads = "press,x_mm,y_mm,travel_mm,force_n"
    rows = [(number, 5 * number, y, *row) for y in (0, 5) for number in (1, 2) for row in PRESS]
    with pytest.raises(TsisError, match=r"the rows of press 1 lie up to 5 mm apart: number all presses through"):
        read_scan(written(tmp_path / "robot.csv", rows, heads), indenter=BALL)
    unnumbered = [("", x, 0, *row) for x in (0, 0.5) for row in PRESS]
    with pytest.raises(TsisError, match=r"column press numbers 1: number each press, or leave the column out"):
        read_scan(written(tmp_path / "robot.csv", unnumbered, heads), indenter=BALL)


@pytest.mark.parametrize("zero_n", [-1.0, -0.05, 0.05, 1.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_zero_of_a_force_is_taken_off_where_the_press_begins_above_the_tissue(zero_n: float, sign: float) -> None:
    travel = np.linspace(0.0, 4.0, 81)
    force = 0.05 * np.maximum(travel - 1.0, 0.0) ** 1.5
    pairs = loading_part(travel, sign * force + zero_n)
    np.testing.assert_allclose(pairs, np.column_stack([travel, force]), atol=1e-12)


def test_a_stated_force_needs_no_force_line() -> None:
    """Frames do not hold the force that the table of places states."""
    response = nominal_calibration(Sensor(), LightMap.uniform())
    usable = UsableCalibration(calibration=ProbeCalibration(name="bench", response=response), identity="0" * 64)
    frame = TactileImage(grey=np.ones((8, 8)), mm_per_pixel=(1.0, 1.0))
    stated = tuple(ScanPress(place_mm=(x, 0.0), frame=frame, force_n=1.0 + x) for x in (0.0, 1.0))
    scan, read = calibrated(Scan(presses=stated), usable)
    assert [press.frame.force_n for press in scan.presses if press.frame] == [1.0, 2.0]
    assert read is not None
    assert read.force_sd == response.force_sd
    unknown = Scan(presses=(stated[0], replace(stated[1], force_n=None)))
    with pytest.raises(TsisError, match="force_line"):
        calibrated(unknown, usable)


@pytest.mark.parametrize(
    "heads",
    [
        "id,pos_x_mm,pos_y_mm,pos_z_mm,force_x,force_z_N,stamp",
        "point,x (mm),y position / mm,Indentation depth (mm),Fx (N),Normal force (N),t (s)",
        "no,Position X [mm],Position Y [mm],Penetration [mm],side,Z force [N],seconds",
    ],
)
def test_headings_of_other_programs_name_place_travel_and_force(tmp_path: Path, heads: str) -> None:
    table = tmp_path / "robot.csv"
    rows = [f"{at},{x},2,{depth},7,{depth * depth / 10},0\n" for x in (0, 5) for at, depth in enumerate((0, 1, 2))]
    table.write_text(f"{heads}\n{''.join(rows)}")
    presses = read_scan(table, indenter=BALL).scan.presses
    assert [press.place_mm for press in presses] == [(0.0, 2.0), (5.0, 2.0)]
    np.testing.assert_allclose(np.asarray(presses[1].travel_force), [[0.0, 0.0], [1.0, 0.1], [2.0, 0.4]])


@pytest.mark.parametrize(
    ("poses", "sentence"),
    [
        (None, "must be a folder with poses.csv"),
        ("file,x_mm\na.csv,1\n", "missing: y_mm"),
        ("file,x_mm,y_mm\n../a.csv,1,2\nb.csv,1,3\n", "poses.csv', line 2"),
        ("file,x_mm,y_mm\ngone.csv,1,2\nb.csv,1,3\n", "gone.csv"),
        ("file,x_mm,y_mm,probe\nb.csv,1,2,tsis-2011\nb.csv,1,3,tsis-domed\n", "must be of one probe"),
        ("file,x_mm,y_mm\nb.csv,nan,2\nb.csv,1,3\n", "x_mm must be a finite number"),
        ("file,x_mm,y_mm\nb.csv,1,2\n", "at least two presses"),
        ("file,x_mm,y_mm,kind\nb.csv,1,2,bone\nb.csv,1,3,press\n", "kind must be press or reference"),
        ("file,x_mm,y_mm,force_n\nb.csv,1,2,-1\nb.csv,1,3,1\n", "force_n must lie in"),
        ("file,x_mm,y_mm\nc.csv,1,2\nb.csv,1,3\n", "each ring from 1 on"),
        ("file,x_mm,y_mm\nd.csv,1,2\nb.csv,1,3\n", "each ring from 1 on"),
        ("file,x_mm,y_mm\ne.csv,1,2\nb.csv,1,3\n", "each ring from 1 on"),
        ("file,x_mm,y_mm\nb.csv,1,2\nb.csv,1,3\n", "line 2 has the same file at another place; got 'b.csv'"),
    ],
)
def test_wrong_input_is_one_sentence(tmp_path: Path, poses: str | None, sentence: str) -> None:
    (tmp_path / "b.csv").write_text("ring,sector,pressure_kpa\n1,1,2\n2,1,2\n3,1,2\n")
    (tmp_path / "c.csv").write_text("ring,sector,pressure_kpa\n1,1,2\n3,1,2\n")
    (tmp_path / "d.csv").write_text("ring,sector,pressure_kpa\n1,1,2\n2,1,2\n3,1,2\n3,1,9\n")
    (tmp_path / "e.csv").write_text("ring,sector,pressure_kpa\n1000000000,1,2\n1,9999,2\n3.5,1,2\n")
    if poses is not None:
        (tmp_path / "poses.csv").write_text(poses)
    with pytest.raises(TsisError) as stop:
        read_scan(tmp_path)
    assert sentence in str(stop.value)
    assert "\n" not in str(stop.value)
