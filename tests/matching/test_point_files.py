from __future__ import annotations

import os
import pickle
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from tsis.errors import FileInputError
from tsis.matching import point_files as point_file
from tsis.matching.methods import MOST_POINTS
from tsis.matching.point_files import csv_text, read_pair, read_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

POINTS = np.array([[0.1, -2.5, 3.0], [1e-9, 7.0, 1 / 3], [4.0, 5.0, 6.0]])


def ply_bytes(points: NDArray[np.float64], form: str, *, count: int | None = None, kind: str = "double") -> bytes:
    names = "xyz"[: points.shape[1]]
    head = [
        "ply",
        f"format {form} 1.0",
        "comment made by a test",
        f"element vertex {len(points) if count is None else count}",
        "property uchar red",
        *(f"property {kind} {name}" for name in names),
        "element face 0",
        "property list uchar int vertex_index",
        "end_header",
    ]
    if form == "ascii":
        body = "".join("255 " + " ".join(map(repr, row)) + "\n" for row in points.tolist()).encode()
    else:
        order = "<" if "little" in form else ">"
        size = {"double": "f8", "float": "f4"}[kind]
        rows = np.zeros(len(points), dtype=[("red", "u1"), *((name, order + size) for name in names)])
        for axis, name in enumerate(names):
            rows[name] = points[:, axis]
        body = rows.tobytes()
    return "\n".join(head).encode() + b"\n" + body


@given(
    hnp.arrays(
        float,
        st.tuples(st.integers(1, 20), st.sampled_from([2, 3])),
        elements=st.floats(allow_nan=False, allow_infinity=False),
    )
)
def test_csv_round_trip_to_the_last_bit(points: NDArray[np.float64]) -> None:
    back = point_file._parsed(csv_text(points, match=np.arange(len(points))).encode())
    np.testing.assert_array_equal(back, points)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_round_trip(tmp_path: Path, form: str, dimension: int) -> None:
    (tmp_path / "a.ply").write_bytes(ply_bytes(POINTS[:, :dimension], form))
    np.testing.assert_array_equal(read_points(tmp_path / "a.ply"), POINTS[:, :dimension])


def test_ply_floats_line_ends_and_flat_sets(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(ply_bytes(POINTS, "binary_little_endian", kind="float"))
    np.testing.assert_allclose(read_points(tmp_path / "a.ply"), POINTS, rtol=1e-6)
    (tmp_path / "b.ply").write_bytes(ply_bytes(POINTS, "ascii").replace(b"\n", b"\r\n"))
    np.testing.assert_array_equal(read_points(tmp_path / "b.ply"), POINTS)
    (tmp_path / "flat.ply").write_bytes(ply_bytes(POINTS * [1, 1, 0], "ascii"))
    np.testing.assert_array_equal(read_points(tmp_path / "flat.ply"), POINTS[:, :2])


@pytest.mark.parametrize("dtype", ["<f8", ">f4", "<i2", "u1"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_npy_of_any_number_type_and_order(tmp_path: Path, dtype: str, order: str) -> None:
    points = np.array([[1, 2, 3], [4, 5, 6]], dtype=dtype, order=order)  # type: ignore[call-overload]
    np.save(tmp_path / "a.npy", points)
    read = read_points(tmp_path / "a.npy")
    np.testing.assert_array_equal(read, points)
    assert read.dtype == float
    assert not read.flags.writeable


@pytest.mark.parametrize(
    "text",
    [
        "0.5,1\n2,3\n",
        "x,y\n0.5,1\n2,3",
        "\ufeff# a comment\n\n0.5;1\n2;3\n",
        "0.5 1\n 2   3 \n",
        "0.5\t1\r\n2\t3\r\n",
        '"label","Y","X"\na,1,0.5\nb,3,2\n',
        "first,second\n0.5,1\n2,3\n",
        "label;x;y\na, b;0.5;1\nc;2;3\n",
        "label\tx\ty\na, b\t0,5\t1\nc\t2\t3\n",
    ],
)
def test_csv_in_its_many_forms(tmp_path: Path, text: str) -> None:
    (tmp_path / "points.anything").write_text(text, encoding="utf-8")
    np.testing.assert_array_equal(read_points(tmp_path / "points.anything"), [[0.5, 1.0], [2.0, 3.0]])


@given(
    points=hnp.arrays(float, st.tuples(st.integers(4, 8), st.integers(2, 3)), elements=st.floats(-1e6, 1e6, width=32)),
    separator=st.sampled_from(";\t"),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
    named=st.booleans(),
)
def test_tables_with_a_decimal_comma_are_those_with_a_point(
    points: NDArray[np.float64], separator: str, encoding: str, named: bool
) -> None:
    points[:, :] += np.random.default_rng(1).uniform(0.1, 0.4, points.shape)  # else a column may number the rows
    rows = [separator.join(repr(value).replace(".", ",") for value in row) for row in points.tolist()]
    heads = [separator.join(("x / µm", "y / µm", "z / µm")[: points.shape[1]])] if named else []
    with TemporaryDirectory() as folder:
        file = Path(folder) / "points.csv"
        file.write_text("\n".join([*heads, *rows]), encoding=encoding)
        np.testing.assert_array_equal(read_points(file), points)


def pickled_npy(path: Path) -> None:
    with path.open("wb") as file:
        np.lib.format.write_array(file, np.array([[Trap(), 1], [2, 3]], dtype=object), allow_pickle=True)


class Trap:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, ("touch unpickled",)


def npy_header(shape: str, descr: str = "'<f8'") -> bytes:
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"1,2,3,4,5,6,7,8,9,10\n", "2 or 3 columns; got 10"),
        (b"a,b,c,d\n1,2,3,4\n", "2 or 3 columns; got 4"),
        (b"1\n2\n", "2 or 3 columns; got 1"),
        (b"x,y\n1,2\n3,nan\n", "line 3 must hold finite numbers; got 'nan'"),
        (b"1,2\n3,inf\n", "line 2 must hold finite numbers"),
        (b"1,2\n3,4 mm\n", "line 2 must hold finite numbers; got '4 mm'"),
        (b"1,2\n3\n", "line 2 must have 2 columns"),
        (b"1,2\n3,4,5\n", "line 2 must have 2 columns as the first one; got 3"),
        (b"0,5;1,5\n2,5;3.x\n", "line 2 must hold finite numbers; got '3.x'"),
        (b"1.5;2.5\n2,5;3,5\n", "line 1 must hold finite numbers; got '1.5'"),
        (b"x,y\n", "it must hold at least 1 point; got 0"),
        (b"# nothing\n\n", "must hold points; got none"),
        (b"\xff\xfe\x00\xd8", "must be CSV, NPY or PLY"),
        (pickle.dumps([1.0, 2.0]), "must be CSV, NPY or PLY"),
        (b"PK\x03\x04\xff\xff", "must be CSV, NPY or PLY"),
        (npy_header("(1000000000000, 2)") + bytes(64), "at most 200000 points; got 1000000000000"),
        (npy_header("(5, 2)") + bytes(64), "5 points take 80 bytes; got 64"),
        (npy_header("(4, 2)") + bytes(80), "4 points take 64 bytes; got 80"),
        (npy_header("(-4, 2)") + bytes(64), "got -4"),
        (npy_header("(4,)") + bytes(32), "shape"),
        (npy_header("(4, 2)", "'|O'") + bytes(64), "never unpickled"),
        (npy_header("(4, 2)", "'<U3'") + bytes(64), "must hold real numbers"),
        (npy_header("(((("), "NPY header must be whole"),
        (b"\x93NUMPY\x01\x00\xff\xff{", "NPY header must be whole"),
        (b"\x93NUMPY\x09\x00\xff\xff{", "NPY header must be whole"),
        (npy_header("(1, 2)") + np.array([1.0, np.nan]).tobytes(), "row 0 must be finite"),
        (ply_bytes(POINTS, "ascii", count=10**12), "at most 200000 points; got 1000000000000"),
        (ply_bytes(POINTS, "binary_little_endian", count=10**12), "got 1000000000000"),
        (ply_bytes(POINTS, "binary_little_endian", count=4), "4 vertices of its header take 100 bytes; got 75"),
        (ply_bytes(POINTS, "ascii", count=5), "5 vertices of its header; got 3"),
        (ply_bytes(POINTS, "ascii", count=-1), "got -1"),
        (ply_bytes(POINTS, "ascii")[:-20], "3 vertices of its header; got 2"),
        (ply_bytes(POINTS, "ascii")[:-12], "vertex 2 must hold"),
        (ply_bytes(POINTS, "ascii")[:60], "header must end"),
        (ply_bytes(POINTS, "ascii").replace(b"format ascii", b"format morse"), "known form; got 'format morse 1.0'"),
        (ply_bytes(POINTS, "ascii").replace(b"double y", b"double x"), "'x' twice"),
        (ply_bytes(POINTS, "ascii").replace(b"double y", b"double v"), "must have x and y"),
        (ply_bytes(POINTS, "ascii").replace(b"vertex 3", b"vertex many"), "known"),
        (ply_bytes(POINTS, "ascii").replace(b"element vertex 3", b"element face 3"), "vertices as the first"),
        (ply_bytes(POINTS, "ascii").replace(b"property uchar red", b"property list uchar int a"), "known"),
        (ply_bytes(np.array([[0.0, np.nan]]), "binary_big_endian"), "vertex 0 must be finite"),
        (b"ply\n" + b"comment x\n" * 100_000, "header must end within"),
    ],
)
def test_broken_files_are_refused_in_one_sentence(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(FileInputError, match=message) as refused:
        read_points(tmp_path / "a")
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 400


def test_objects_are_never_unpickled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    pickled_npy(tmp_path / "a.npy")
    with pytest.raises(FileInputError, match="never unpickled"):
        read_points(tmp_path / "a.npy")
    assert not (tmp_path / "unpickled").exists()


def test_missing_empty_and_huge_files_and_folders(tmp_path: Path) -> None:
    with pytest.raises(FileInputError, match="does not exist"):
        read_points(tmp_path / "none.csv")
    (tmp_path / "empty.csv").touch()
    with pytest.raises(FileInputError, match="empty file"):
        read_points(tmp_path / "empty.csv")
    with pytest.raises(FileInputError, match="folder"):
        read_points(tmp_path)
    with (tmp_path / "huge.csv").open("wb") as file:
        file.truncate(10**12)  # sparse: it takes no room on the disk
    with pytest.raises(FileInputError, match="at most 160 MiB"):
        read_points(tmp_path / "huge.csv")


def test_more_points_than_the_limit_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(point_file, "MOST_POINTS", 2000)
    (tmp_path / "many.csv").write_text("1,2\n" * 2001)
    with pytest.raises(FileInputError, match="got 2001"):
        read_points(tmp_path / "many.csv")


@pytest.mark.slow
def test_more_points_than_any_file_may_hold_are_refused(tmp_path: Path) -> None:
    (tmp_path / "many.csv").write_text("1,2\n" * (MOST_POINTS + 1))
    with pytest.raises(FileInputError, match=f"got {MOST_POINTS + 1}"):
        read_points(tmp_path / "many.csv")


@given(
    st.binary(max_size=300), st.sampled_from([b"", b"ply\n", npy_header("(2, 2)"), ply_bytes(POINTS, "ascii")[:150]])
)
def test_no_bytes_make_it_fail_in_another_way(noise: bytes, start: bytes) -> None:
    try:
        points = point_file._parsed(start + noise)
    except FileInputError:
        return
    assert np.isfinite(points).all()


@pytest.mark.parametrize(("least", "discs"), [(1.0, 1), (0.25, 2)])
def test_points_of_an_image_lie_on_the_contours_that_are_long_enough(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, least: float, discs: int
) -> None:
    monkeypatch.setattr(point_file, "LEAST_CONTOUR", least)
    y, x = np.mgrid[:120, :200]
    known = np.array([(60.0, 50.0, 30.0), (150.0, 80.0, 12.0)])  # x, rows from above, radius
    grey = np.zeros(x.shape)
    for across, down, radius in known:
        grey += 200 * np.clip(radius - np.hypot(x - across, y - down) + 0.5, 0.0, 1.0)
    Image.fromarray(grey.astype(np.uint8)).save(tmp_path / "discs.png")
    points = read_points(tmp_path / "discs.png")
    away = np.abs(np.hypot(points[:, :1] - known[:, 0], 119 - points[:, 1:] - known[:, 1]) - known[:, 2])
    assert away.min(axis=1).max() < 0.5
    assert len(set(away.argmin(axis=1).tolist())) == discs


@pytest.mark.parametrize(
    "text",
    [
        "id,x,y\n7,1,2\n8,3,5\n9,4,1\n",
        "y,x\n2,1\n5,3\n1,4\n",
        "frame;y [mm];x [mm]\n3;2;1\n3;5;3\n3;1;4\n",
        "X (mm),Y (mm),weight\n1,2,9\n3,5,9\n4,1,9\n",
        '"index","x_um","y_um"\n0,1,2\n1,3,5\n2,4,1\n',
        ",x,y\n0,1,2\n1,3,5\n2,4,1\n",
        "id,u,v\n4,1,2\n5,3,5\n6,4,1\n",
        "u,v,Index\n1,2,4\n3,5,5\n4,1,6\n",
        "x/mm\ty/mm\tframe\n1\t2\t1\n3\t5\t1\n4\t1\t1\n",
    ],
)
def test_coordinates_are_taken_by_name_and_an_index_never(tmp_path: Path, text: str) -> None:
    (tmp_path / "points.csv").write_text(text, encoding="utf-8")
    np.testing.assert_array_equal(read_points(tmp_path / "points.csv"), [[1, 2], [3, 5], [4, 1]])


@pytest.mark.parametrize("head", ["3\nof a scanner\n", "3\n"])
def test_the_count_and_remark_of_an_xyz_file_are_no_points(tmp_path: Path, head: str) -> None:
    path = tmp_path / "a.xyz"
    path.write_text(head + "0.5 1 2\n3 4 5\n6 7 8\n", encoding="utf-8")
    assert read_points(path).tolist() == [[0.5, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]]


def test_a_pair_drops_an_equal_z_only_where_the_other_has_none(tmp_path: Path) -> None:
    flat, plane, space = (tmp_path / name for name in ("flat.csv", "plane.csv", "space.csv"))
    flat.write_text("1,2,7\n3,4,7\n", encoding="utf-8")
    plane.write_text("5,6\n7,8\n", encoding="utf-8")
    space.write_text("1,2,3\n4,5,6\n", encoding="utf-8")
    assert [each.tolist() for each in read_pair(flat, plane)] == [[[1.0, 2.0], [3.0, 4.0]], [[5.0, 6.0], [7.0, 8.0]]]
    assert [each.shape for each in read_pair(flat, space)] == [(2, 3), (2, 3)]
    with pytest.raises(FileInputError, match=r"got 2 coordinates in '.*plane\.csv' and 3 in"):
        read_pair(plane, space)


def test_z_is_taken_by_name_too(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("z [mm],id,y [mm],x [mm]\n3,0,2,1\n6,1,5,4\n")
    np.testing.assert_array_equal(read_points(tmp_path / "points.csv"), [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("place", ["first", "last"])
def test_an_unnamed_running_number_is_no_coordinate(tmp_path: Path, first: int, dimension: int, place: str) -> None:
    points = np.random.default_rng(dimension).normal(size=(9, dimension))
    number = np.arange(first, first + 9.0)
    columns = [number, *points.T] if place == "first" else [*points.T, number]
    np.savetxt(tmp_path / "points.csv", np.column_stack(columns), delimiter=",", fmt="%.17g")
    np.testing.assert_array_equal(read_points(tmp_path / "points.csv"), points)


def test_columns_that_do_not_number_the_rows_are_coordinates(tmp_path: Path) -> None:
    points = np.column_stack([np.arange(5.0) * 2, np.arange(5.0), [4.0, 1.0, 0.0, 3.0, 2.0]])
    for some in (points, points[:, 1:]):
        np.savetxt(tmp_path / "points.csv", some, delimiter=",")
        np.testing.assert_array_equal(read_points(tmp_path / "points.csv"), some)


@pytest.mark.parametrize("text", ["x,x,y\n1,2,3\n", "a,b,c,d\n1,2,3,4\n", "id,u\n1,2\n"])
def test_unclear_names_of_columns_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "points.csv").write_text(text)
    with pytest.raises(FileInputError, match=r"must (name|have)"):
        read_points(tmp_path / "points.csv")
