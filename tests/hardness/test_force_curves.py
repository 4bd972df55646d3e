"""Moduli from curves of force over depth, against Hertz's law, Sneddon's solutions and the maker of an indenter."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import tsis
from tsis.errors import FileInputError, InputError
from tsis.hardness.curve_files import read_curves
from tsis.hardness.curve_flags import INDENTATION_FLAGS
from tsis.hardness.force_curves import ForceCurve, repeated_modulus

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import NDArray

REAL = Path(__file__).parents[3] / "shared" / "data" / "real" / "force_curves"
RADIUS_MM, YOUNG_KPA = 3.0, 20.0


def pressed(
    young_kpa: float = YOUNG_KPA,
    radius_mm: float = RADIUS_MM,
    noise: float = 2e-3,
    seed: int = 1,
    contact_mm: float = 0.1,
    points: int = 600,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A shallow press of a ball on a thick block, by Hertz's law, with noise, an offset and a tilt."""
    position = np.linspace(-0.2, 0.08, points) * radius_mm / 3
    below = np.maximum(position - contact_mm * 0.1 * radius_mm / 3, 0.0)
    force = 4 / 3 * young_kpa * 1e-3 / (1 - 0.49**2) * np.sqrt(radius_mm) * below**1.5
    peak = force.max()
    rng = np.random.default_rng(seed)
    return position, force + peak * (0.3 + 0.02 * position / np.ptp(position) + noise * rng.standard_normal(points))


def interval(curve: ForceCurve, **options: Any) -> tuple[float, float]:
    return tsis.hardness.indentation(curve, **options).interval()["young_kpa"]


@pytest.mark.parametrize("radius_mm", [2e-3, 3.0, 40.0])
@pytest.mark.parametrize("young_kpa", [0.1, 150.0])
def test_a_ball_of_any_size_tells_the_modulus_of_hertz(radius_mm: float, young_kpa: float) -> None:
    position, force = pressed(young_kpa, radius_mm)
    estimate = tsis.hardness.indentation(ForceCurve(position_mm=position, force_n=force), radius_mm=radius_mm)
    low, high = estimate.interval()["young_kpa"]
    assert estimate.trusted
    assert low < young_kpa < high
    assert estimate.mean["young_kpa"] == pytest.approx(young_kpa, rel=0.06)


@pytest.mark.parametrize(("power", "shape"), [(1.0, "punch"), (1.5, "ball"), (2.0, "cone")])
def test_a_curve_of_another_indenter_is_withheld(power: float, shape: str) -> None:
    """The force on a thick block grows with the depth to the power 1, 1.5 or 2 under punch, ball and cone."""
    rng, position = np.random.default_rng(4), np.linspace(-0.2, 0.1, 600)
    depth = np.maximum(position, 0.0)
    curve = ForceCurve(position_mm=position, force_n=0.01 * (depth / 0.1) ** power + 5e-5 * rng.standard_normal(600))
    for stated in ("punch", "ball", "cone"):
        result = tsis.hardness.indentation(curve, indenter=stated, radius_mm=1.0, half_angle_deg=45.0)
        assert ("indenter_doubtful" in result.flags) == (stated != shape)
        assert result.trusted == (stated == shape)


def test_signs_and_the_return_do_not_matter() -> None:
    position, force = pressed()
    there = interval(ForceCurve(position_mm=position, force_n=force), radius_mm=RADIUS_MM)
    back = ForceCurve(
        position_mm=-np.concatenate([position, position[::-1]]), force_n=np.concatenate([force, force[::-1]])
    )
    assert interval(back, radius_mm=RADIUS_MM) == pytest.approx(there, rel=0.02)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))])
def test_a_record_may_begin_at_full_depth(sign: int, seed: int) -> None:
    """A retreat listed before the way in, a deep start, or a relaxation before both: the way in tells the modulus."""
    position, force = pressed(seed=seed)
    there = interval(ForceCurve(position_mm=position, force_n=force), radius_mm=RADIUS_MM)
    deeper, greater = pressed(seed=seed + 10)
    starts = {
        "retreat": (position[::-1], 0.9 * (force[::-1] - force[:50].mean()) + force[:50].mean()),
        "greater": (deeper[::-1], 1.05 * (greater[::-1] - greater[:50].mean()) + greater[:50].mean()),
        "dwell": (np.full(200, position[-1]), np.linspace(0.99, 0.8, 200) * force[-1]),
    }
    starts["dwell"] = tuple(np.concatenate(pair) for pair in zip(starts["dwell"], starts["retreat"], strict=True))  # type: ignore[assignment]
    for before, pulled in starts.values():
        curve = ForceCurve(
            position_mm=sign * np.concatenate([before, position]), force_n=np.concatenate([pulled, force])
        )
        assert interval(curve, radius_mm=RADIUS_MM) == pytest.approx(there, rel=0.05)


@pytest.mark.parametrize("order", ["newest first", "by position"])
def test_rows_that_are_not_in_the_order_of_time_are_put_into_it(tmp_path: Path, order: str) -> None:
    position, force = pressed()
    way = np.concatenate([position, position[::-1]])
    back = np.maximum(force[::-1] - 0.15 * np.ptp(force), force[0])  # the sample gives back less than it took
    table = np.column_stack([np.arange(way.size) / 100, way, np.concatenate([force, back])])
    rows = table[::-1] if order == "newest first" else table[np.argsort(way, kind="stable")]
    found = []
    for name, values in (("time.csv", table), ("other.csv", rows)):
        np.savetxt(tmp_path / name, values, delimiter=",", header="time_s,position_mm,force_n", comments="")
        (curve,) = read_curves(tmp_path / name)
        found.append(interval(curve, radius_mm=RADIUS_MM))
    assert found[0] == pytest.approx(found[1], rel=1e-6)
    assert dict(curve.recorded or {})["order"] == "rows sorted by time"


@pytest.mark.parametrize(
    ("heading", "labels"), [("curve", ("1", "2")), ("Specimen", ("left", "right")), ("Repeat", ("0", "1"))]
)
def test_a_column_that_tells_curves_apart_gives_a_curve_for_each(
    tmp_path: Path, heading: str, labels: tuple[str, str]
) -> None:
    """One fit through both gave a trusted modulus of neither."""
    presses = [pressed(noise=0.02), pressed(1.2 * YOUNG_KPA, noise=0.02, seed=2)]
    lines = [
        f"{label},{x:.9f},{y:.9f}"
        for label, press in zip(labels, presses, strict=True)
        for x, y in zip(*press, strict=True)
    ]
    (tmp_path / "two.csv").write_text("\n".join([f"{heading},Position (mm),Force (N)", *lines]))
    curves = read_curves(tmp_path / "two.csv")
    assert [curve.name for curve in curves] == [f"two.csv, {heading.lower()} {label}" for label in labels]
    for curve, (position, force) in zip(curves, presses, strict=True):
        np.testing.assert_allclose(curve.position_mm, position, atol=1e-8)
        np.testing.assert_allclose(curve.force_n, force, atol=1e-8)


@pytest.mark.parametrize("sample", [range(600), [1] * 600, [1] * 590 + [2] * 10, [*[""] * 300, *[1] * 300]])
def test_a_column_that_counts_points_or_tells_segments_parts_no_curve(tmp_path: Path, sample: Sequence[object]) -> None:
    position, force = pressed()
    lines = [f"{label},{x:.9f},{y:.9f}" for label, x, y in zip(sample, position, force, strict=True)]
    (tmp_path / "one.csv").write_text("\n".join(["Sample,Position (mm),Force (N)", *lines]))
    (curve,) = read_curves(tmp_path / "one.csv")
    assert (curve.name, curve.position_mm.size) == ("one.csv", 600)


def test_segments_whose_time_begins_anew_stay_as_they_are(tmp_path: Path) -> None:
    position, force = pressed()
    time = np.concatenate([np.arange(600) / 100, np.arange(600) / 100 + 0.001])
    table = np.column_stack([time, np.concatenate([position, position[::-1]]), np.concatenate([force, force[::-1]])])
    np.savetxt(tmp_path / "two.csv", table, delimiter=",", header="time_s,position_mm,force_n", comments="")
    (curve,) = read_curves(tmp_path / "two.csv")
    np.testing.assert_array_equal(curve.force_n, table[:, 2])


@pytest.mark.parametrize(
    ("column", "row", "jump"), [("force_n", 40, -30.0), ("force_n", 500, 3.0), ("position_mm", 550, 9)]
)
def test_a_row_that_stands_alone_does_not_move_the_modulus(column: str, row: int, jump: float) -> None:
    values = dict(zip(("position_mm", "force_n"), pressed(), strict=True))
    there = interval(ForceCurve(**values), radius_mm=RADIUS_MM)  # type: ignore[arg-type]
    values[column] = values[column].copy()
    values[column][row] += jump * np.ptp(values[column])
    estimate = tsis.hardness.indentation(ForceCurve(**values), radius_mm=RADIUS_MM)  # type: ignore[arg-type]
    assert estimate.interval()["young_kpa"] == pytest.approx(there, rel=0.02)
    assert "rows_replaced" in estimate.flags


def test_a_fast_approach_before_a_slow_press_is_no_hold() -> None:
    position, force = pressed(points=2000)
    far = np.linspace(-30 * np.ptp(position), position[0], 60)[:-1]
    way = np.concatenate([far, position, position[::-1]])
    curve = ForceCurve(position_mm=way, force_n=np.concatenate([np.full(59, force[:200].mean()), force, force[::-1]]))
    estimate = tsis.hardness.indentation(curve, radius_mm=RADIUS_MM)
    assert "hold_relaxes" not in estimate.flags
    assert estimate.mean["young_kpa"] == pytest.approx(YOUNG_KPA, rel=0.06)


def test_a_clear_contact_of_few_points_after_a_long_wait_is_one() -> None:
    position, force = pressed(noise=1e-3)
    wait = np.full(6000, position[0]), np.full(6000, force[0])
    rng = np.random.default_rng(5)
    curve = ForceCurve(
        position_mm=np.concatenate([wait[0], position]),
        force_n=np.concatenate([wait[1] + 1e-3 * np.ptp(force) * rng.standard_normal(6000), force]),
    )
    estimate = tsis.hardness.indentation(curve, radius_mm=RADIUS_MM)
    assert estimate.trusted
    assert estimate.mean["young_kpa"] == pytest.approx(YOUNG_KPA, rel=0.06)


@pytest.mark.parametrize(("indenter", "options"), [("punch", {"radius_mm": 2.0}), ("cone", {"half_angle_deg": 40.0})])
def test_punch_and_cone_tell_the_modulus_of_sneddon(indenter: str, options: dict[str, Any]) -> None:
    position = np.linspace(-0.5, 0.3, 600)
    below = np.maximum(position - 0.02, 0.0)
    reduced = 30e-3 / (1 - 0.49**2)
    force = (
        2 * 2.0 * reduced * below if indenter == "punch" else 2 / np.pi * np.tan(np.radians(40)) * reduced * below**2
    )
    force = force + 1e-3 * force.max() * np.random.default_rng(2).standard_normal(600)
    low, high = interval(ForceCurve(position_mm=position, force_n=force), indenter=indenter, **options)
    assert low < 30.0 < high < 1.15 * low


def test_the_bending_of_the_machine_is_taken_off() -> None:
    position, force = pressed()
    bends = 0.2
    moved = position + bends * (force - force[:50].mean())
    low, high = interval(ForceCurve(position_mm=moved, force_n=force), radius_mm=RADIUS_MM, compliance_mm_per_n=bends)
    assert low < YOUNG_KPA < high


def test_errors_of_force_and_radius_widen_the_interval() -> None:
    curve = ForceCurve(position_mm=pressed()[0], force_n=pressed()[1])
    narrow = np.subtract(*interval(curve, radius_mm=RADIUS_MM)[::-1])
    wide = np.subtract(*interval(curve, radius_mm=RADIUS_MM, force_sd=0.1)[::-1])
    assert wide > 0.3 * YOUNG_KPA > narrow


def test_a_curve_whose_parts_disagree_is_told_and_its_interval_holds_the_modulus_all_the_same() -> None:
    """A slip takes an eighth of the peak force away, or waves of 15 % run over the force: neither is the model's."""
    position, force = pressed(noise=5e-4)
    below = np.maximum(position - 0.01, 0.0) / (position.max() - 0.01)
    slipped = force - 0.12 * np.ptp(force) * (below > 0.6)
    waved = force[:100].mean() + (force - force[:100].mean()) * (1 + 0.15 * np.sin(7 * below))
    even, *others = (
        tsis.hardness.indentation(ForceCurve(position_mm=position, force_n=curve), radius_mm=RADIUS_MM)
        for curve in (force, slipped, waved)
    )
    assert "changes_with_depth" not in even.flags
    for uneven in others:
        low, high = uneven.interval()["young_kpa"]
        assert "changes_with_depth" in uneven.flags
        assert low < YOUNG_KPA < high


def test_noise_alone_is_no_contact() -> None:
    rng = np.random.default_rng(3)
    estimate = tsis.hardness.indentation(
        ForceCurve(position_mm=np.linspace(0, 1, 500), force_n=rng.standard_normal(500)), radius_mm=3.0
    )
    assert not estimate.trusted
    assert "no_contact" in estimate.flags


def test_a_hold_that_relaxes_and_a_pull_on_leaving_are_told() -> None:
    position, force = pressed(noise=1e-3)
    rise = force.max() - force[:50].mean()
    rest = np.exp(-np.linspace(0, 3, 200)) * 0.2 * rise + force.max() - 0.2 * rise
    pull = force[::-1] - 0.3 * rise * np.exp(-(((position[::-1] - position[300]) / 0.03) ** 2))
    curve = ForceCurve(
        position_mm=np.concatenate([position, np.full(200, position[-1]), position[::-1]]),
        force_n=np.concatenate([force, rest, pull]),
    )
    flags = tsis.hardness.indentation(curve, radius_mm=RADIUS_MM).flags
    assert {"hold_relaxes", "adhesion"} <= set(flags)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "radius_mm must be given"),
        ({"radius_mm": 51.0}, "radius_mm must lie in"),
        ({"radius_mm": 3.0, "indenter": "needle"}, "no indenter is called 'needle'"),
        ({"indenter": "cone"}, "half_angle_deg must be given"),
        ({"radius_mm": 3.0, "poisson": (0.4, 0.6)}, "poisson"),
        ({"radius_mm": 3.0, "thickness_mm": float("nan")}, "thickness_mm"),
    ],
)
def test_invalid_values_are_refused_in_a_sentence(options: dict[str, Any], message: str) -> None:
    position, force = pressed()
    with pytest.raises(InputError, match=message):
        tsis.hardness.indentation(ForceCurve(position_mm=position, force_n=force), **options)


def test_curves_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match="of one length"):
        ForceCurve(position_mm=np.arange(40.0), force_n=np.arange(39.0))
    with pytest.raises(InputError, match="constant"):
        ForceCurve(position_mm=np.zeros(40), force_n=np.arange(40.0))


def test_repeats_tell_the_scatter_from_press_to_press() -> None:
    """Presses whose forces differ by a log sd of 0.18, as a robot's did, where one curve says 0.02."""
    found = []
    for number, log in enumerate((-0.2, 0.18, 0.02, -0.1, 0.1)):
        position, force = pressed(YOUNG_KPA * float(np.exp(log)), seed=number)
        found.append(tsis.hardness.indentation(ForceCurve(position_mm=position, force_n=force), radius_mm=RADIUS_MM))
    together = repeated_modulus(found)
    assert together is not None
    assert together.count == 5
    assert together.scatter == pytest.approx(0.155, abs=0.02)
    low, high = together.interval_kpa
    assert low < YOUNG_KPA < high
    assert np.log(high / low) > 2 * 0.14
    assert repeated_modulus(found[:2]) is None


TABLES = {  # headings, a row, size of the units of length and force, decimal mark
    "tsis.csv": ("depth_mm,force_n", "{p},{f}", 1.0, 1.0, "."),
    "mark-10.csv": ("Reading,Load [N],Travel [mm],Time [s]", "{n},{f},{p},{n}", 1.0, 1.0, "."),
    "mecmesin.txt": ("Time (s)\tLoad (mN)\tDisplacement (µm)", "{n}\t{f}\t{p}", 1e3, 1e3, "."),
    "deutsch.csv": ("Zeit / s;Kraft / N;Weg / mm", "{n};{f};{p}", 1.0, 1.0, ","),
    "univert.csv": ("SetName,Cycle,Time_S,Displacement_mm,Force_N", "Set1,1-Press,{n},{p},{f}", 1.0, 1.0, "."),
    "wavematrix.csv": (
        '"Total Time (s)","Step","Displacement(Linear:Digital Position) (mm)","Load(Linear:Load) (N)"',
        "{n},2,{p},{f}", 1.0, 1.0, ".",
    ),
    "triboscan.txt": (
        "\nNumber of Points = 600\n\nDepth (nm)\tLoad (µN)\tTime (s)\tDepth (V)\tLoad (V)",
        "{p}\t{f}\t{n}\t0.1\t0.2", 1e6, 1e6, ".",
    ),
    "anton-paar.txt": ("Sample: gel\n\nTime [s]\tPd [nm]\tFn [mN]", "{n}\t{p}\t{f}", 1e6, 1e3, "."),
    "trapezium.csv": ('"1 _ 1","","",\n"Time","Force","Stroke"\n"sec","N","mm"', '"{n}","{f}","{p}"', 1.0, 1.0, "."),
    "testsuite.txt": (
        "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\n\nAxial Displacement\tAxial Force\tRunning Time\nmm\tN\tSec",
        "{p}\t{f}\t{n}", 1.0, 1.0, ".",
    ),
    "nanosuite.csv": (
        "Segment,Displacement Into Surface,Load On Sample,Time On Sample\n,nm,mN,s", ",{p},{f},{n}", 1e6, 1e3, "."
    ),
    "femtotools.txt": ("Index,Phase,Displacement [µm],Time [s],Force A [µN]", "{n},1,{p},{n},{f}", 1e3, 1e6, "."),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_exports_are_read_by_name_and_unit(tmp_path: Path, name: str) -> None:
    heading, row, lengths, forces, mark = TABLES[name]
    position, force = pressed()
    lines = [heading]
    for number, (x, y) in enumerate(zip(position, force, strict=True)):
        cells = row.format(p=f"{x * lengths:.6f}", f=f"{y * forces:.8f}", n=number)
        lines.append(cells if mark == "." else cells.replace(".", mark))
    path = tmp_path / name
    path.write_text("\n".join(lines), encoding="utf-8")
    (curve,) = read_curves(path)
    assert curve.position_mm == pytest.approx(position, abs=1e-6)
    assert curve.force_n == pytest.approx(force, abs=1e-7)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "must hold data"),
        (b"depth,force\n1,2\n", "unit"),
        (b"PK\x03\x04 broken", "ZIP"),
        (b"a,b\n1,2\n", "missing.* call the column force .N."),
        (b'"a (s)","b (mm)"\n1,2\n', "missing: force_n; got 'a .s., b .mm.'"),
        (b"Calc_Ramp_Ex_nm\tDefl_V_Ex\n1\t0.2\n", "multiply it by spring constant and sensitivity"),
        (b"Extend Z-Sense(nm),Extend T-B(V)\n1,0.2\n", "multiply it by spring constant and sensitivity"),
        (b"\\*Force file list\r\n\\Version: 0x09200000\r\n\x1a\x00", "NanoScope: export force and separation"),
        (b"[DataSet]\r\nVersion=2\r\n#!\x00", "Nanosurf: export"),
        (b"TDSm\x0e\x00", "LabVIEW: write its channels as CSV"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\x00", "Excel: save its sheet as CSV"),
        (b"MATLAB 5.0 MAT-file\x00", "MAT file: write it by writetable"),
        (b"\x93NUMPY\x01\x00", "numpy.savetxt"),
        (b"IGOR\nWAVES/D\tForce\nBEGIN\n1\nEND\n", "Igor: save its waves as delimited text"),
        (b'{"force_n": [1, 2]}', "JSON: write a table"),
        (b"force_n,depth_mm\nmN,um\n1,2\n2,3\n", "must have one unit; it states 'n', and the line below 'mN'"),
    ],
)
def test_other_files_are_refused_in_a_sentence(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "curve.csv"
    path.write_bytes(content)
    with pytest.raises(FileInputError, match=message):
        read_curves(path)


def test_a_workbook_is_no_archive_of_curves(tmp_path: Path) -> None:
    path = tmp_path / "curves.xlsx"
    with zipfile.ZipFile(path, "w") as book:
        book.writestr("[Content_Types].xml", "<Types/>")
        book.writestr("xl/worksheets/sheet1.xml", "<worksheet/>")
    with pytest.raises(FileInputError, match="a workbook: save its sheet as CSV"):
        read_curves(path)


def jpk_text(position: NDArray[np.float64], force: NDArray[np.float64], spring: float) -> str:
    """A text as JPK's program exports it: each segment has a head of its own, heights fall towards the sample."""
    lines = ["# xPosition: 0.0", "# date: Tue Mar 22 17:41:56 GMT 2011", "#"]
    height = 5e-5 - 1e-3 * position - force / spring
    for segment, order in (("extend", slice(None)), ("retract", slice(None, None, -1))):
        lines += [
            f"# segment: {segment}",
            "# columns: height vDeflection smoothedMeasuredHeight seriesTime",
            '# fancyNames: "Height" "Vertical Deflection" "Height (measured & smoothed)" "Series Time"',
            f"# springConstant: {spring}",
            "# units: m N m s",
            "#",
        ]
        lines += [f"9 {f:.9E} {h:.12E} 0.1" for h, f in zip(height[order], force[order], strict=True)]
        lines.append("")
    return "\n".join(lines)


def test_a_text_that_jpk_exported_gives_the_place_of_the_tip(tmp_path: Path) -> None:
    position, force = pressed(2.0, 0.01)
    path = tmp_path / "curve.txt"
    path.write_text(jpk_text(position, force, 0.05))
    (curve,) = read_curves(path)
    assert len(curve.force_n) == 2 * len(force)
    assert curve.position_mm[:600] - curve.position_mm[0] == pytest.approx(position - position[0], abs=1e-8)
    assert curve.force_n[:600] == pytest.approx(force, rel=1e-6)
    low, high = interval(curve, radius_mm=0.01)
    assert low < 2.0 < high
    path.write_text(jpk_text(position, force, 0.05).replace("units: m N", "units: m V"))
    with pytest.raises(FileInputError, match=r"vDeflection in N .* export it calibrated"):
        read_curves(path)


def real(name: str) -> Path:
    path = REAL / name
    if not path.exists():
        pytest.skip(f"{path} is not there: real curves are not part of the project")
    return path


def test_a_text_of_chiaro_is_read_with_its_radius_and_the_makers_modulus() -> None:
    (curve,) = read_curves(real("fmt-chiaro-txt_AEBP1_Indentation_002.zip"))
    assert curve.radius_mm == pytest.approx(0.0275)
    assert curve.recorded is not None
    assert curve.recorded["maker_young_kpa"] == pytest.approx(0.117, abs=1e-4)
    assert curve.force_n.max() == pytest.approx(4.9e-8, rel=0.02)


def test_a_map_of_jpk_is_read_with_all_curves() -> None:
    path = real("fmt-jpk-fd_map2x2_extracted.jpk-force-map")
    pytest.importorskip("afmformats", reason="the extra curves is not installed")
    curves = read_curves(path)
    assert len(curves) == 4
    assert curves[0].force_n.max() == pytest.approx(1.64e-9, rel=0.01)


@pytest.mark.parametrize("name", ["chiaro-txt_AEBP1_Indentation_002.zip", "jpk-cc_pr14-brain-2021.06.30.jpk-force"])
def test_a_damaged_file_of_another_program_is_refused_in_a_sentence_or_read(tmp_path: Path, name: str) -> None:
    whole = bytearray(real(f"fmt-{name}").read_bytes())
    pytest.importorskip("afmformats", reason="the extra curves is not installed")
    rng, refused = np.random.default_rng(11), list[str]()
    for number in range(60):
        damaged = bytearray(whole)
        start = int(rng.integers(len(whole)))
        if number % 2:
            del damaged[start : start + int(rng.choice([1, 20, 1000]))]
        else:
            damaged[start] ^= 0xFF
        path = tmp_path / name
        path.write_bytes(damaged)
        try:
            read_curves(path)
        except FileInputError as error:
            refused.append(str(error))
    assert len(refused) > 10
    assert not any("\n" in sentence for sentence in refused)


def test_flags_have_a_meaning_and_those_that_withhold_a_cure() -> None:
    assert all(flag.means and (flag.cure or not flag.withholds) for flag in INDENTATION_FLAGS.values())
