"""Young's modulus from contacts of a gel sensor: against Hertz and finite strain, what is withheld, what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tsis.catalog.sensors import load_sensor
from tsis.errors import FileInputError, InputError, NotIdentifiedError, UnknownNameError, UntrustedError
from tsis.hardness import estimate_from_contacts
from tsis.hardness.contacts import ObjectGeometry, TouchReading, as_touch_readings
from tsis.hardness.sphere import hertzian_radius_mm as contact_radius_of
from tsis.hardness.sphere import press_fields
from tsis.imaging.gel_contact import contacts as find_contacts
from tsis.mechanics.finite_strain.soft_sphere import SphereResolution
from tsis.model.gel_sensor import BoundedValue, GelSensor
from tsis.model.phantom import SoftSphere
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from pathlib import Path

    import tsis

GEL = GelSensor(
    name="thick",
    width_mm=40.0,
    height_mm=40.0,
    thickness_mm=BoundedValue(value=100.0),
    young_kpa=BoundedValue(value=150.0),
    poisson=BoundedValue(value=0.49),
    mm_per_pixel=(0.1, 0.1),
)
R_MM = 10.0


def hertz(young_kpa: float, forces: tuple[float, ...] = (0.1, 0.2), gel_kpa: float = 150.0) -> list[dict[str, float]]:
    """Contacts by Hertz's law, shallow enough for small strain."""
    compliance = (1 - 0.4725**2) / young_kpa + (1 - 0.49**2) / gel_kpa
    radii = [float(np.cbrt(0.75 * 1e3 * force * R_MM * compliance)) for force in forces]
    share = (1 - 0.49**2) / gel_kpa / compliance
    backing = 0.74 / 100.0  # of the contact radius: what a backing 100 mm below takes off the dent of Hertz's law
    return [
        {"force_n": force, "radius_mm": radius, "depth_mm": share * radius**2 / R_MM * (1 - backing * radius)}
        for force, radius in zip(forces, radii, strict=True)
    ]


def by_force(young_kpa: float) -> list[dict[str, float]]:
    """The same without the dents."""
    return [{name: row[name] for name in ("force_n", "radius_mm")} for row in hertz(young_kpa)]


def middle(estimate: tsis.Estimate) -> float:
    return float(np.median(estimate.samples["young_kpa"]))


@pytest.mark.parametrize("young_kpa", [20.0, 60.0, 200.0])
def test_hertzian_contacts_give_the_modulus(young_kpa: float) -> None:
    found = estimate_from_contacts(hertz(young_kpa), sensor=GEL, geometry=R_MM)
    low, high = found.interval(0.9)["young_kpa"]
    assert low < young_kpa < high
    assert middle(found) == pytest.approx(young_kpa, rel=0.06)


def test_the_dent_replaces_the_force() -> None:
    contacts = [{name: row[name] for name in ("radius_mm", "depth_mm")} for row in hertz(60.0)]
    found = estimate_from_contacts(contacts, sensor=GEL, geometry=R_MM)
    assert middle(found) == pytest.approx(60.0, rel=0.08)


def test_an_error_of_the_gels_modulus_passes_one_to_one() -> None:
    firm, soft = (
        estimate_from_contacts(by_force(60.0), sensor=replace(GEL, young_kpa=BoundedValue(value=gel)), geometry=R_MM)
        for gel in (157.5, 142.5)
    )
    scaled = estimate_from_contacts(
        [row | {"force_n": 1.1 * row["force_n"]} for row in hertz(60.0)],
        sensor=replace(GEL, young_kpa=BoundedValue(value=165.0)),
        geometry=R_MM,
    )
    assert middle(scaled) == pytest.approx(
        1.1 * middle(estimate_from_contacts(hertz(60.0), sensor=GEL, geometry=R_MM)), rel=0.01
    )
    assert middle(firm) < middle(soft), "a stiffer gel leaves more of the compliance to the object"


def test_a_stiff_object_widens_by_the_gels_part() -> None:
    """``sd(ln E) = sd / (1 - s)``: both with the same readings' errors."""
    widths = {}
    for young in (20.0, 200.0):
        contacts = [{name: row[name] for name in ("force_n", "radius_mm")} for row in hertz(young)]
        ball = ObjectGeometry(radius_mm=R_MM, radius_sd_mm=0.0)
        found = estimate_from_contacts(contacts, sensor=GEL, geometry=ball, force_zero_sd_n=0.0)
        low, high = found.untrusted.interval(0.9)["young_kpa"]
        widths[young] = np.log(high / low)
    part = {young: ((1 - 0.4725**2) / young) / ((1 - 0.4725**2) / young + (1 - 0.49**2) / 150.0) for young in widths}
    assert widths[200.0] / widths[20.0] == pytest.approx(part[20.0] / part[200.0], rel=0.15)


def test_limits_of_the_gel_widen_and_a_rigid_ball_narrows() -> None:
    unknown = replace(GEL, young_kpa=BoundedValue(low=100.0, high=225.0))
    known = estimate_from_contacts(by_force(60.0), sensor=GEL, geometry=R_MM, force_zero_sd_n=0.0)
    wide = estimate_from_contacts(by_force(60.0), sensor=unknown, geometry=R_MM, force_zero_sd_n=0.0)
    ball = by_force(1e9)
    result = estimate_from_contacts(
        by_force(60.0), sensor=unknown, geometry=R_MM, force_zero_sd_n=0.0, reference=ball, reference_radius_mm=R_MM
    )
    sd = {
        name: float(np.log(each.untrusted.samples["young_kpa"]).std())
        for name, each in (("known", known), ("wide", wide), ("told", result))
    }
    assert sd["known"] < sd["told"] < 0.9 * sd["wide"]
    assert abs(np.log(middle(result) / 60.0)) < 2 * sd["told"]


@pytest.mark.slow
def test_a_press_at_finite_strain_on_a_thin_gel_gives_the_modulus() -> None:
    """Sphere and gel of finite elements, finer than those to which the correction was fitted, at other values."""
    gel, sphere = 120.0, SoftSphere(radius_mm=6.0, young_kpa=70.0, poisson=0.47)
    probe = Probe(radius_mm=15.0, layers=(Layer(thickness_mm=4.5, young_kpa=gel, poisson=0.49),))
    forces = [0.5, 1.0]
    fields = press_fields(
        probe, sphere, forces_n=forces, resolution=SphereResolution(order=3, cells=6, rings=2, face_cells=6)
    )
    contacts = [
        {"force_n": force, "radius_mm": contact_radius_of(field)} for force, field in zip(forces, fields, strict=True)
    ]
    thin = replace(
        GEL, thickness_mm=BoundedValue(value=4.5), young_kpa=BoundedValue(value=gel), width_mm=30.0, height_mm=30.0
    )
    found = estimate_from_contacts(contacts, sensor=thin, geometry=6.0)
    low, high = found.interval(0.9)["young_kpa"]
    assert low < 70.0 < high
    assert middle(found) == pytest.approx(70.0, rel=0.1)


def test_a_cylinder_on_its_side() -> None:
    compliance = (1 - 0.4725**2) / 60.0 + (1 - 0.49**2) / 150.0
    forces = (0.5, 1.0)
    widths = [float(np.sqrt(4 * 1e3 * force / 20.0 * R_MM * compliance / np.pi)) for force in forces]
    contacts = [{"force_n": force, "radius_mm": width} for force, width in zip(forces, widths, strict=True)]
    geometry = ObjectGeometry(shape="cylinder", radius_mm=R_MM, length_mm=20.0)
    found = estimate_from_contacts(contacts, sensor=GEL, geometry=geometry)
    assert middle(found) == pytest.approx(60.0, rel=0.1)


@pytest.mark.parametrize("columns", [("force_n", "radius_mm"), ("radius_mm", "depth_mm")])
def test_a_soft_cylinder_at_finite_strain(columns: tuple[str, str]) -> None:
    """Two presses by NGSolve (benchmarks/soft_cylinder.py), not those to which the correction was fitted."""
    pressed = [
        {"force_n": 0.28307, "radius_mm": 1.6002, "depth_mm": 0.10891},
        {"force_n": 1.34929, "radius_mm": 3.2215, "depth_mm": 0.26309},
    ]
    gel = replace(GEL, thickness_mm=BoundedValue(value=4.0))
    found = estimate_from_contacts(
        [{name: press[name] for name in columns} for press in pressed],
        sensor=gel,
        geometry=ObjectGeometry(shape="cylinder", radius_mm=6.0, length_mm=10.0),
    )
    low, high = found.interval(0.9)["young_kpa"]
    assert low < 100.0 < high
    assert middle(found) == pytest.approx(100.0, rel=0.05)


@pytest.mark.parametrize(
    ("contacts", "geometry", "reason"),
    [
        (hertz(60.0), "flat", "contact of a flat object"),
        ([{"radius_mm": 2.0, "depth_mm": 0.2}], "sphere", "force and radius of the object are both unknown"),
        ([{"radius_mm": 2.0}], R_MM, "without a force each contact needs"),
    ],
)
def test_what_cannot_be_identified_is_withheld_with_its_reason(contacts: Any, geometry: Any, reason: str) -> None:
    found = estimate_from_contacts(contacts, sensor=GEL, geometry=geometry)
    assert "young_kpa_not_identified" in found.flags
    assert reason in " ".join(found.notes)
    with pytest.raises(NotIdentifiedError):
        _ = found.mean["young_kpa"]
    low, high = found.interval(0.9)["young_kpa"]
    assert high > 100 * low


def test_contacts_that_contradict_each_other_and_large_ones_are_not_trusted() -> None:
    apart = [{"force_n": 0.1, "radius_mm": 1.5}, {"force_n": 0.2, "radius_mm": 3.0}]
    mixed = estimate_from_contacts(apart, sensor=GEL, geometry=R_MM)
    assert "model_does_not_fit" in mixed.flags
    with pytest.raises(UntrustedError):
        _ = mixed.interval(0.9)
    assert (
        "contact_too_deep"
        in estimate_from_contacts([{"force_n": 30.0, "radius_mm": 9.5}], sensor=GEL, geometry=R_MM).flags
    )
    assert (
        "contact_too_wide"
        in estimate_from_contacts([{"force_n": 30.0, "radius_mm": 13.0}], sensor=GEL, geometry=50.0).flags
    )
    assert "gel_not_flat" in estimate_from_contacts(hertz(60.0), sensor="digit", geometry=R_MM).flags


def test_a_sequence_counts_as_one_press() -> None:
    loading = hertz(60.0, (0.05, 0.1, 0.15, 0.2))
    there_and_back = [*loading, {"force_n": 0.1, "radius_mm": 3.4}]
    once = estimate_from_contacts(there_and_back, sensor=GEL, geometry=R_MM, sequence=True)
    several = estimate_from_contacts(loading, sensor=GEL, geometry=R_MM)
    assert len(once.provenance["contacts"]) == 4
    assert once.sd["young_kpa"] > several.sd["young_kpa"]


def test_contacts_of_a_release_are_left_out_and_named() -> None:
    there_and_back = [
        *hertz(60.0, (0.05, 0.1, 0.2)),
        {"force_n": 0.1, "radius_mm": 3.4},
        {"force_n": 0.05, "radius_mm": 3},
    ]
    result = estimate_from_contacts(there_and_back, sensor=GEL, geometry=R_MM, sequence=True)
    assert "contacts_left_out" in result.flags
    assert any(note.endswith("where it is released, were left out: 2.") for note in result.notes)


def test_a_press_that_is_listed_from_its_largest_contact_on_is_refused_without_times() -> None:
    backwards = hertz(60.0, (0.05, 0.1, 0.15, 0.2))[::-1]
    with pytest.raises(InputError, match="order of time"):
        estimate_from_contacts(backwards, sensor=GEL, geometry=R_MM, sequence=True)
    with pytest.raises(InputError, match="order of time"):
        estimate_from_contacts([row | {"press": 3} for row in backwards], sensor=GEL, geometry=R_MM)
    timed = [row | {"time_s": 0.1 * number} for number, row in enumerate(backwards)]
    result = estimate_from_contacts(timed, sensor=GEL, geometry=R_MM, sequence=True)
    assert len(result.provenance["contacts"]) == 1
    assert "contacts_left_out" in result.flags


def test_contacts_of_a_held_press_may_begin_with_the_largest() -> None:
    held = [row | {"force_n": row["force_n"] * factor} for row in hertz(60.0, (0.2,)) for factor in (1.01, 0.99, 1.0)]
    assert estimate_from_contacts(held, sensor=GEL, geometry=R_MM, sequence=True).trusted


def test_contacts_of_a_ball_need_a_force_and_those_left_out_are_named() -> None:
    ball = [{"force_n": 0.1, "radius_mm": 1.5}, {"force_n": 0.2, "radius_mm": 1.9, "good": "no"}]
    result = estimate_from_contacts(hertz(60.0), sensor=GEL, geometry=R_MM, reference=ball, reference_radius_mm=5.0)
    assert "contacts_left_out" in result.flags
    for wrong, said in (
        ({"reference": [{"radius_mm": 1.5}], "reference_radius_mm": 5.0}, "must state force_n"),
        ({"reference_radius_mm": 5.0}, "reference must be given with reference_radius_mm"),
    ):
        with pytest.raises(InputError, match=said):
            estimate_from_contacts(hertz(60.0), sensor=GEL, geometry=R_MM, **wrong)
    with pytest.raises(InputError, match="must be given with radius_sd_mm"):
        estimate_from_contacts(hertz(60.0), sensor=GEL, geometry={"radius_sd_mm": 0.1})


def test_two_different_radii_of_one_object_are_refused() -> None:
    stated = [row | {"object_radius_mm": R_MM} for row in hertz(60.0)]
    assert estimate_from_contacts(stated, sensor=GEL, geometry=1.01 * R_MM).trusted
    with pytest.raises(InputError, match="leave one of them out"):
        estimate_from_contacts(stated, sensor=GEL, geometry=2 * R_MM)


def test_any_program_may_have_read_the_contacts(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    rows = hertz(60.0)
    areas = [{"force_n": row["force_n"], "area_mm2": np.pi * row["radius_mm"] ** 2} for row in rows]
    file = tmp_path / "contacts.csv"
    file.write_text(
        "force_n,radius_mm,depth_mm\n" + "".join(f"{r['force_n']},{r['radius_mm']},{r['depth_mm']}\n" for r in rows)
    )
    expected = middle(estimate_from_contacts(rows, sensor=GEL, geometry=R_MM))
    readings = [TouchReading(**dict[str, Any](row)) for row in rows]
    for contacts in (pandas.DataFrame(rows), file, str(file), readings):
        assert middle(estimate_from_contacts(contacts, sensor=GEL, geometry=R_MM)) == pytest.approx(expected, rel=1e-9)
    radii_alone = [{name: row[name] for name in ("force_n", "radius_mm")} for row in rows]
    same = [middle(estimate_from_contacts(each, sensor=GEL, geometry=R_MM)) for each in (areas, radii_alone)]
    assert same[0] == pytest.approx(same[1], rel=1e-6)
    given = [{"radius_mm": row["radius_mm"]} for row in rows]
    forced = estimate_from_contacts(given, sensor=GEL, geometry=R_MM, force=[row["force_n"] for row in rows])
    assert middle(forced) == pytest.approx(same[1], rel=1e-6)


def test_the_scale_counts_once(tmp_path: Path) -> None:
    """Contacts of `tsis.imaging.gel_contact.contacts` state the scale in their sd; the sensor states it again for all
    of them."""
    row = {"force_n": 0.2, "radius_mm": 2.0, "radius_sd_mm": 2.0 * float(np.hypot(0.01, 0.05)), "scale_sd": 0.05}
    file = tmp_path / "contacts.csv"
    file.write_text(",".join(row) + "\n" + ",".join(str(value) for value in row.values()) + "\n")
    area = {
        "force_n": 0.2, "area_mm2": np.pi * 4.0, "area_sd_mm2": 8 * np.pi * float(np.hypot(0.01, 0.05)),
        "scale_sd": 0.05,
    }  # fmt: skip
    for contacts in (row, file, area):
        (reading,), _, _ = as_touch_readings(contacts)
        assert reading.radius_sd_mm == pytest.approx(0.02, rel=1e-6)
    (all_scale,), _, _ = as_touch_readings(row | {"radius_sd_mm": 0.1})
    assert all_scale.radius_sd_mm == pytest.approx(0.005)  # not zero: what rounding leaves
    with pytest.raises(InputError, match="scale_sd of contact 1 must lie in"):
        as_touch_readings(row | {"scale_sd": 0.7})


@pytest.mark.parametrize("word", [True, 1, 1.0, "yes", "TRUE", "", None, float("nan"), np.True_])
def test_a_row_that_is_called_good_or_nothing_counts(word: object) -> None:
    row = {"force_n": 0.2, "radius_mm": 2.0, "good": word}
    assert len(as_touch_readings([row, row])[0]) == 2


@pytest.mark.parametrize("word", [False, 0, 0.0, "no", "n", "F", "bad", np.False_])
def test_a_row_that_is_called_bad_does_not_count(word: object) -> None:
    row = {"force_n": 0.2, "radius_mm": 2.0}
    readings, refused, _ = as_touch_readings([row, row | {"good": word}])
    assert (len(readings), len(refused)) == (1, 1)


def test_other_words_and_columns_that_contradict_each_other_are_refused() -> None:
    row = {"force_n": 0.2, "radius_mm": 2.0}
    with pytest.raises(InputError, match=r"good must be true or false, 1 or 0, yes or no; got 'nein'"):
        as_touch_readings([row | {"good": "nein"}])
    as_touch_readings([row | {"area_mm2": 12.6}])
    with pytest.raises(InputError, match=r"2 mm has 12\.6 mm2, and 3\.14 mm2 is stated"):
        as_touch_readings([row | {"area_mm2": 3.14}])
    with pytest.raises(InputError, match=r"radius_mm"):
        as_touch_readings([row | {"radius_mm": 0.0, "area_mm2": 3.14}])


def test_contacts_of_frames_say_which_part_of_their_sd_is_the_scale() -> None:
    sensor = replace(load_sensor("9dtact"), scale_uncertainty=0.04)
    y, x = np.mgrid[:345, :460]
    hill = np.maximum(1.0 - ((x - 230) ** 2 + (y - 170) ** 2) / 60.0**2, 0.0)
    frames = [
        np.clip(120 + change + np.random.default_rng(1).normal(0, 1, x.shape), 0, 255) for change in (-50 * hill, 0)
    ]
    (found,) = find_contacts(frames[:1], sensor=sensor, reference=frames[1])
    (reading,), _, _ = as_touch_readings(replace(found, good=True), force=0.5)
    assert reading.radius_sd_mm is not None
    assert reading.radius_mm is not None
    assert reading.radius_sd_mm / reading.radius_mm == pytest.approx(found.radius_sd_px / found.radius_px, rel=1e-3)


def test_bad_contacts_are_left_out_and_said() -> None:
    rows = [*hertz(60.0), {"force_n": 0.3, "radius_mm": 9.0, "good": False}]
    found = estimate_from_contacts(rows, sensor=GEL, geometry=R_MM)
    assert "contacts_left_out" in found.flags
    assert len(found.provenance["contacts"]) == 2


def test_presses_that_are_too_wide_are_left_out_but_not_the_end_of_one_press() -> None:
    rows = hertz(60.0)
    wide = [*rows, {"force_n": 30.0, "radius_mm": 13.0}]
    assert "contact_too_wide" in estimate_from_contacts(wide, sensor=GEL, geometry=R_MM, sequence=True).flags
    found = estimate_from_contacts(wide, sensor=GEL, geometry=R_MM)
    assert found.interval(0.9) == estimate_from_contacts(rows, sensor=GEL, geometry=R_MM).interval(0.9)
    assert "Contacts wider than 0.6 of the face or 0.9 of the object's radius were left out: 1." in found.notes


@pytest.mark.parametrize(
    ("contacts", "options", "message"),
    [
        ([], {}, "at least one contact; got none"),
        ([{"force_n": 1.0}], {}, "must have radius_mm, area_mm2 or depth_mm"),
        ([{"force_n": -1.0, "radius_mm": 1.0}], {}, "force_n of contact 1 must lie in"),
        ([{"force_n": 1.0, "radius_mm": "wide"}], {}, "radius_mm of contact 1 must be a number; got 'wide'"),
        ([{"force_n": 1.0, "radius_mm": np.inf}], {}, "radius_mm of contact 1"),
        ([{"radius_mm": 1.0}], {"force": [1.0, 2.0]}, "one for each of the 1 contacts; got 2"),
        ([{"radius_mm": 1.0, "good": False}], {}, "all 1 are marked as not good"),
        (hertz(60.0), {"geometry": {"shape": "cylinder", "radius_mm": 5.0}}, "length_mm of a cylinder"),
        (hertz(60.0), {"geometry": 500.0}, "radius_mm of the object must lie in"),
        (hertz(60.0), {"reference": hertz(1e9)}, "reference_radius_mm must be given"),
        (hertz(60.0), {"press_sd": 3.0}, "press_sd must lie in"),
        ([7.0], {}, "contacts must have radius_mm, area_mm2 or depth_mm; got float"),
    ],
)
def test_wrong_input_is_one_sentence(contacts: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        estimate_from_contacts(contacts, **dict[str, Any](sensor=GEL, geometry=R_MM) | options)
    assert "\n" not in str(refused.value)


def test_wrong_files_and_names_are_one_sentence(tmp_path: Path) -> None:
    empty = tmp_path / "empty.csv"
    empty.write_text("force,size\n1,2\n")
    with pytest.raises(FileInputError, match="must have a header with radius_mm"):
        as_touch_readings(empty)
    with pytest.raises(FileInputError):
        as_touch_readings(tmp_path / "absent.csv")
    with pytest.raises(UnknownNameError):
        estimate_from_contacts(hertz(60.0), sensor="gelsite-mini", geometry=R_MM)


@pytest.mark.parametrize(
    ("table", "encoding"),
    [
        ("force_n,radius_mm\n0.2,2.5\n0.4,3.125\n", "utf-8"),
        ("force / N;radius / mm\n0,2;2,5\n0,4;3,125\n", "utf-8-sig"),
        ("Nr.\tForce (mN)\tContact radius (µm)\n1\t200\t2500\n2\t400\t3125\n", "utf-16"),
        (";Force_N;Radius_mm;remark\n0;0.2;2.5;dry\n1;0.4;3.125;\n", "utf-8"),
        ("Load [g],Radius [mm]\n20.394324259558566,2.5\n40.78864851911713,3.125\n", "cp1252"),
    ],
)
def test_a_table_of_any_program_gives_the_same_contacts(tmp_path: Path, table: str, encoding: str) -> None:
    file = tmp_path / "contacts.csv"
    file.write_bytes(table.encode(encoding))
    readings, refused, _ = as_touch_readings(file)
    assert [reading.force_n for reading in readings] == pytest.approx([0.2, 0.4])
    assert [reading.radius_mm for reading in readings] == pytest.approx([2.5, 3.125])
    assert refused == ()


@pytest.mark.parametrize("zero_n", [-0.03, 0.02, 0.05])
def test_a_zero_error_of_the_force_lies_within_the_interval(zero_n: float) -> None:
    """Two contacts of small force: the interval is wide; four up to ten times as much tell the zero."""
    found = []
    for forces in ((0.15, 0.25), (0.15, 0.4, 0.8, 1.5)):
        contacts = [{**row, "force_n": row["force_n"] + zero_n} for row in hertz(100.0, forces)]
        low, high = estimate_from_contacts(contacts, sensor=GEL, geometry=R_MM).interval()["young_kpa"]
        assert low < 100.0 < high
        found.append(np.log(high / low))
    assert found[1] < 0.8 * found[0]


def rising(lag_s: float, *, young_kpa: float = 60.0, presses: int = 2) -> list[dict[str, float]]:
    """Presses that rise along a smooth ramp in a second, the gauge read later by the lag."""
    contacts = []
    for press in range(presses):
        course = 0.05 + 0.2 * (1 + press) * np.sin(np.linspace(0.1, np.pi / 2, 8)) ** 2
        late = 0.05 + 0.2 * (1 + press) * np.sin(np.linspace(0.1, np.pi / 2, 8) + np.pi / 2 * lag_s) ** 2
        for number, (contact, read) in enumerate(zip(hertz(young_kpa, tuple(course)), late, strict=True)):
            time = number / 7.0
            contacts.append({"press": press, "time_s": time, "radius_mm": contact["radius_mm"], "force_n": float(read)})
    return contacts


def test_a_lag_of_the_gauge_is_told_by_the_rise() -> None:
    """A fast rise and its end differ by the lag alone: without it the readings contradict each other, or mislead."""
    options: dict[str, Any] = {"sensor": GEL, "geometry": R_MM, "force_zero_sd_n": 0.0}
    late = rising(0.15)
    known, blind = (estimate_from_contacts(late, **options, lag_sd_s=sd) for sd in (0.1, 0.0))
    low, high = known.untrusted.interval(0.9)["young_kpa"]
    assert low < 60.0 < high
    errors = [abs(np.log(float(np.median(found.untrusted.samples["young_kpa"])) / 60.0)) for found in (known, blind)]
    assert errors[0] < errors[1]


def test_the_error_of_a_press_is_shared_by_its_contacts_alone() -> None:
    contacts = rising(0.0, presses=3)
    options: dict[str, Any] = {"sensor": GEL, "geometry": R_MM, "force_zero_sd_n": 0.0, "press_sd": 0.08}
    three = estimate_from_contacts(contacts, **options)
    one = estimate_from_contacts([contact | {"press": 0} for contact in contacts[:8]], **options)
    three_sd, one_sd = (float(np.log(found.untrusted.samples["young_kpa"]).std()) for found in (three, one))
    assert three_sd == pytest.approx(one_sd / np.sqrt(3), rel=0.2)


def test_times_of_a_press_must_ascend() -> None:
    contacts = rising(0.0)[:8]
    with pytest.raises(InputError, match="must ascend"):
        estimate_from_contacts(contacts[::-1], sensor=GEL, geometry=R_MM)


def test_a_modulus_on_a_label_is_wider_than_a_measured_one() -> None:
    label, measured = (
        replace(GEL, sources={"young_kpa": source}) for source in ("Shore hardness on the label", "measured by us")
    )
    widths = [
        np.log(high / low)
        for sensor in (label, measured)
        for low, high in [
            estimate_from_contacts(
                by_force(200.0), sensor=sensor, geometry=R_MM, force_zero_sd_n=0.0
            ).untrusted.interval(0.9)["young_kpa"]
        ]
    ]
    assert widths[0] > 1.1 * widths[1]
    assert label.believed_young_kpa.limits == pytest.approx((120.0, 187.5))
    assert measured.believed_young_kpa == GEL.young_kpa
