from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import list_probes, load_probe, probe_toml
from tsis.cli.options import calibrated_probe, chosen_probe, read_probe
from tsis.errors import FileInputError, NotCalibratedError
from tsis.mechanics import press
from tsis.model.probe import Glass, Layer, Led, Probe

if TYPE_CHECKING:
    from tests.cli.conftest import RunTsis

ROOT = Path(__file__).parents[2]
SOFT = """
[soft]
radius_mm = 10.0
layers = [{ thickness_mm = 8.0, young_kpa = 30.0 }]
"""


@pytest.mark.parametrize("name", list_probes())
def test_every_probe_of_the_catalog_comes_back_from_a_file(tmp_path: Path, name: str) -> None:
    known = load_probe(name)
    text = probe_toml(known).replace(f"[{name}", "[mine")  # and its glass, a table of its own
    (tmp_path / "mine.TOML").write_text(text, encoding="utf-8")
    found = chosen_probe(str(tmp_path / "mine.TOML"))
    assert found.name == "mine"
    assert (found.layers, found.leds, found.glass) == (known.layers, known.leds, known.glass)
    assert (found.radius_mm, found.face_curvature_mm, found.sides) == (
        known.radius_mm,
        known.face_curvature_mm,
        known.sides,
    )
    assert found.assumed == known.assumed


@given(
    radius=st.floats(1, 100),
    layers=st.lists(st.tuples(st.floats(0.01, 200), st.floats(0.1, 1e6)), min_size=1, max_size=5),
    glass=st.floats(0.01, 50),
    azimuths=st.lists(st.floats(-360, 360), min_size=1, max_size=6),
)
def test_what_the_console_saves_is_read_as_it_was(
    tmp_path_factory: pytest.TempPathFactory,
    radius: float,
    layers: list[tuple[float, float]],
    glass: float,
    azimuths: list[float],
) -> None:
    probe = Probe(
        radius_mm=radius,
        layers=tuple(Layer(thickness_mm=thickness, young_kpa=young) for thickness, young in layers),
        glass=Glass(thickness_mm=glass),
        leds=tuple(Led(azimuth_deg=azimuth) for azimuth in azimuths),
        name="my probe (soft)",
    )
    file = tmp_path_factory.mktemp("probes") / "mine.toml"
    file.write_text(probe_toml(probe), encoding="utf-8")
    assert read_probe(file) == probe


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        ("# nothing", "one probe, a table under its name as [my-probe]; got nothing"),
        ("radius_mm = 10.0", "one probe, a table under its name as [my-probe]; got radius_mm"),
        (SOFT + SOFT.replace("soft", "other"), "got soft, other"),
        (SOFT + "\n[", "must be TOML"),
        (SOFT.replace("soft", "tsis-2011"), "that of a probe of the catalog"),
        (SOFT.replace("[soft]", '["[red]"]'), "the name must be"),
        (SOFT.replace("[soft]", '["\\u001b"]'), "the name must be"),
        (SOFT.replace("radius_mm", "radius"), "did you mean 'radius_mm'"),
        (SOFT.replace("young_kpa", "modulus"), "no value of a layer is called 'modulus'"),
        (SOFT.replace(", young_kpa = 30.0", ""), "a layer must give thickness_mm and young_kpa"),
        (SOFT.replace("30.0", '"soft"'), "young_kpa must be a number"),
        (SOFT.replace("10.0", "0.1"), "radius_mm must lie in"),
        (SOFT.replace("[{ thickness_mm = 8.0, young_kpa = 30.0 }]", "[]"), "at least one Layer"),
        (SOFT.replace("[{ thickness_mm = 8.0, young_kpa = 30.0 }]", "3"), "layers must be tables"),
        ("[soft]\nradius_mm = 10.0", "a probe must give radius_mm and layers; got radius_mm"),
        (SOFT + "leds = []", "at least one with power above 0"),
        (SOFT + "leds = [{ colour = 3 }]", "no value of a lamp is called 'colour'"),
        (SOFT + "leds = [" + "{ azimuth_deg = 1.0 }," * 101 + "]", "leds must be at most 100; got 101"),
        (SOFT + "glass = 3", "glass must be tables"),
        (SOFT + "glass = { index = 1.5 }", "no value of the glass is called 'index'"),
        (SOFT + "assumed = [1]", "assumed must be a list of names"),
        (SOFT + "sides = 'glued'", "sides must be 'free' or 'bonded'"),
        (SOFT + "face_curvature_mm = 'round'", "face_curvature_mm must be a number"),
        (SOFT + "leds = [{ " + "a." * 100 + "a = 1 }]", "at most 16 parts"),
    ],
)
def test_a_file_that_is_no_probe_is_refused_in_one_sentence(tmp_path: Path, text: str, phrase: str) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(FileInputError) as result:
        read_probe(file)
    assert phrase in str(result.value)
    assert "mine.toml" in str(result.value)


def test_a_file_that_is_no_text_or_not_there_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_bytes(b"\xff\xfe\x00")
    for name, phrase in (("mine.toml", "text in UTF-8"), ("other.toml", "other.toml")):
        with pytest.raises(FileInputError, match=phrase):
            chosen_probe(str(tmp_path / name))


def test_commands_take_the_file(run_tsis: RunTsis, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(SOFT, encoding="utf-8")
    found = json.loads(
        run_tsis("simulate", "--probe", "mine.toml", "--force-n", "0.5", "--strain", "small", "--json").out
    )
    mine = Probe(radius_mm=10.0, layers=(Layer(thickness_mm=8.0, young_kpa=30.0),))
    expected = press(mine, load_phantom("hardness-100"), force_n=0.5)
    np.testing.assert_allclose(found["pressure_kpa"], expected.pressure_kpa, rtol=1e-12)
    assert found["probe"]["name"] == "soft"
    for command in (("angles",), ("trace", "--rays", "4000")):
        light = json.loads(run_tsis("optics", *command, "--probe", "mine.toml", "--json").out)
        assert light["probe"]["radius_mm"] == 10.0


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        (("optics", "angles", "--probe", "mine.toml", "--aim-deg", "3"), "change leds in that file"),
        (("demo", "--probe", "mine.toml", "--save"), "--save needs a probe of the catalog"),
        (("hardness", "--demo", "--probe", "mine.toml", "--save"), "--save needs a probe of the catalog"),
        (("simulate", "--probe", "none.toml"), "none.toml"),
        (("design", "--probe", "none.toml"), "none.toml"),
    ],
)
def test_what_a_file_cannot_do_is_said(run_tsis: RunTsis, tmp_path: Path, given: tuple[str, ...], phrase: str) -> None:
    (tmp_path / "mine.toml").write_text(SOFT, encoding="utf-8")
    finished = run_tsis(*given)
    assert finished.code == 2
    assert phrase in " ".join(finished.err.split())
    assert "Traceback" not in finished.err


def test_a_calibration_of_a_probe_of_your_own_asks_for_its_file() -> None:
    with pytest.raises(NotCalibratedError, match=r"probe 'soft', which is not in the catalog: give its file"):
        calibrated_probe("soft", unnamed="tsis-2011")
    assert calibrated_probe("tsis-domed", unnamed="tsis-2011") == load_probe("tsis-domed")
    assert calibrated_probe("", unnamed="tsis-direct") == load_probe("tsis-direct")


def test_the_tutorials_probe_is_one(tmp_path: Path) -> None:
    page = (ROOT / "docs/tutorial/your-own-probe.md").read_text(encoding="utf-8")
    (tmp_path / "soft-dome.toml").write_text(page.partition("```toml\n")[2].partition("```")[0], encoding="utf-8")
    probe = read_probe(tmp_path / "soft-dome.toml")
    assert (probe.name, probe.thickness_mm, len(probe.leds)) == ("soft-dome", 8.0, 3)
