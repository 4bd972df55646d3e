"""``tsis hardness``: a touched object by a probe's frames, and by contacts of a gel sensor."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from tests.hardness.stand_ins import by_table

from tsis.catalog.sensors import load_sensor
from tsis.virtual.direct_contact import DirectContactRig
from tsis.virtual.gel_frames import ball_press, gel_depth_mm, random_gel_light, render_gel

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


IMAGES = ("demo/press-0.7N.png", "demo/press-1.2N.png")
KNOWN = ("--calibration", "demo/calibration.json", "--scale-mm", "0.0336,0.0392")


@pytest.fixture
def quick_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    """Presses by the table of contact radii: the mechanics have tests of their own."""

    class Quick(DirectContactRig):
        def __init__(self, *arguments: object, **options: object) -> None:
            super().__init__(*arguments, solve=by_table, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("tsis.virtual.direct_contact.DirectContactRig", Quick)


@pytest.mark.usefixtures("quick_rig")
def test_the_demo_writes_what_it_prints_and_its_frames_give_the_same(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("hardness", "--demo", "--json", "--out", "demo")
    assert finished.code == 0, finished.err
    printed = json.loads(finished.out)
    assert printed["notice"].startswith("Research use only")
    found = printed["estimate"]["parameters"]["young_kpa"]
    assert found["truth"] == 103.0
    assert abs(found["mean"] - 103.0) < 3.5 * found["sd"]
    assert printed["shore_converted"]["shore_00"] == pytest.approx(29, abs=5)
    page = (tmp_path / "demo" / "index.html").read_text()
    assert "Research use only" in page
    assert "Shore 00 (converted)" in page
    radius = printed["estimate"]["provenance"]["radius"]
    again = run_tsis(
        *("hardness", *IMAGES, *KNOWN, "--force-n", "0.7", "--force-n", "1.2", "--json"),
        *("--radius-mm", str(radius["radius_mm"]), "--radius-sd-mm", str(radius["sd_mm"])),
    )
    assert again.code == 0, again.err
    assert json.loads(again.out)["estimate"]["parameters"]["young_kpa"]["mean"] == pytest.approx(found["mean"])


@pytest.mark.usefixtures("quick_rig")
def test_people_read_a_table(run_tsis: RunTsis) -> None:
    finished = run_tsis("hardness", "--virtual", "cl2003x", "--seed", "3")
    assert finished.code == 0, finished.err
    for words in ("Young's modulus", "90 % interval", "true modulus", "Research use only", "converted, not measured"):
        assert words in finished.out


@pytest.mark.usefixtures("quick_rig")
def test_a_rigid_ball_is_taken_as_reference(run_tsis: RunTsis) -> None:
    assert run_tsis("hardness", "--demo", "--seed", "2", "--out", "demo").code == 0
    refused = run_tsis(
        *("hardness", *IMAGES, *KNOWN, "--force-n", "0.7", "--force-n", "1.2", "--radius-mm", "3", "--ball", IMAGES[0]),
    )
    assert refused.code == 2
    assert "--ball-force-n must be given once for each --ball" in refused.err
    refused = run_tsis(
        *("hardness", IMAGES[1], *KNOWN, "--force-n", "1.2", "--radius-mm", "3"),
        *("--ball", IMAGES[0], "--ball-force-n", "0.7"),
    )
    assert refused.code == 2
    assert "reference_radius_mm" in refused.err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((), "--demo"),
        (("a.png",), "--calibration"),
        (("a.png", "--demo"), "simulate the presses"),
        (("--virtual", "cl2004x"), "did you mean 'cl2003x'"),
        (("--demo", "--force-n", "-1"), "forces_n must lie in"),
        (("--demo", "--probe", "tsis-2012"), "no probe is called"),
    ],
)
def test_wrong_words_end_in_one_sentence(run_tsis: RunTsis, words: tuple[str, ...], sentence: str) -> None:
    finished = run_tsis("hardness", *words)
    assert finished.code == 2
    assert sentence in finished.err
    assert "Traceback" not in finished.err


ROWS = "force_n,radius_mm\n0.5,3.00\n1.0,3.75\n"
GEL = "[my-gel]\nwidth_mm = 40.0\nheight_mm = 40.0\nthickness_mm = 20.0\nyoung_kpa = [140.0, 160.0]\npoisson = 0.49\n"


@pytest.fixture
def contacts(tmp_path: Path) -> Path:
    (tmp_path / "gel.toml").write_text(GEL)
    (tmp_path / "contacts.csv").write_text(ROWS)
    return tmp_path / "contacts.csv"


@pytest.mark.usefixtures("contacts")
def test_contacts_of_a_file_give_the_modulus_for_people_and_programs(run_tsis: RunTsis) -> None:
    order = ("hardness", "--contacts", "contacts.csv", "--sensor", "gel.toml", "--radius-mm", "5")
    printed = json.loads(run_tsis(*order, "--json").out)
    low, high = printed["estimate"]["parameters"]["young_kpa"]["interval_90"]
    assert low < high < 2.5 * low
    assert printed["provenance"]["sensor"]["name"] == "my-gel"
    shown = run_tsis(*order)
    assert shown.code == 0
    assert f"{low:.3g} to {high:.3g} kPa" in shown.out
    assert "Research use only" in shown.out
    forced = json.loads(run_tsis(*order, "--force-n", "1", "--force-n", "2", "--json").out)
    assert forced["estimate"]["parameters"]["young_kpa"]["interval_90"][0] > 1.5 * low


@pytest.mark.usefixtures("contacts")
def test_a_flat_object_is_withheld_with_its_reason(run_tsis: RunTsis) -> None:
    finished = run_tsis("hardness", "--contacts", "contacts.csv", "--sensor", "gel.toml", "--flat")
    assert finished.code == 0
    assert "contact of a flat object does not change" in " ".join(finished.out.split())
    assert run_tsis("hardness", "--contacts", "contacts.csv", "--sensor", "digit", "--radius-mm", "5").code == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("contacts.csv",), "--contacts needs --sensor"),
        (("absent.csv", "--sensor", "gel.toml"), "absent.csv"),
        (("contacts.csv", "--sensor", "absent.toml"), "make one with tsis sensor new"),
        (("contacts.csv", "--sensor", "gel.toml", "--flat", "--cylinder-mm", "3"), "an object has one shape"),
        (("contacts.csv", "--sensor", "gel.toml", "--demo"), "--contacts must stand alone"),
        (("contacts.csv", "--sensor", "gel.toml", "--radius-mm", "900"), "radius_mm of the object must lie in"),
        (("contacts.csv", "--sensor", "gel.toml", "--save", "--out", "made"), "--out and --save must be left out with"),
        (("contacts.csv", "--sensor", "gel.toml", "--forces", "none.csv"), "--forces must be left out with --contacts"),
        (("contacts.csv", "--sensor", "gel.toml", "--seed", "4"), "--seed must be left out with --contacts"),
    ],
)
@pytest.mark.usefixtures("contacts")
def test_wrong_orders_are_one_sentence(run_tsis: RunTsis, arguments: tuple[str, ...], message: str) -> None:
    finished = run_tsis("hardness", "--contacts", *arguments)
    assert finished.code == 2
    assert message in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--demo", "--flat"), "--flat must be left out with --virtual and --demo"),
        (("--demo", "--reference", "none.png", "--sequence"), "--sequence and --reference must be left out"),
        (
            ("one.png", "two.png", "--ball-contacts", "none.csv"),
            "--ball-contacts must be left out with frames of a probe",
        ),
        (("one.png", "two.png", "--seed", "4"), "--seed must be left out with frames of a probe"),
    ],
)
def test_options_of_other_presses_are_refused(run_tsis: RunTsis, arguments: tuple[str, ...], message: str) -> None:
    finished = run_tsis("hardness", *arguments)
    assert finished.code == 2
    assert message in " ".join(finished.err.split())


def gel_film(folder: Path, *, lag_s: float, young_kpa: float = 60.0, ball_mm: float = 8.0) -> None:
    """A film of a Hertzian press on a thick gel of 150 kPa, and a gauge that lags; the face is that of a rigid ball.

    By Hertz a soft ball dents the gel as a rigid one whose radius is larger by the gel's share of the compliance.
    """
    sensor = load_sensor(str(folder / "thick.toml"))
    own, gel = (1 - 0.4725**2) / young_kpa, (1 - 0.485**2) / 150.0
    rng = np.random.default_rng(77)
    columns, rows = sensor.image_px
    light = random_gel_light((rows, columns), rng, size_px=30.0)
    writer = cv2.VideoWriter(str(folder / "press.mkv"), cv2.VideoWriter.fourcc(*"FFV1"), 12.5, (columns, rows))
    flat = np.zeros((rows, columns))

    def force(time: float) -> float:
        return float(0.18 * np.clip((time - 0.5) / 1.2, 0.0, 1.0) ** 1.5)

    for number in range(28):
        newtons, depth = force(number / 12.5), flat
        if newtons > 0.005:
            touched = float(np.cbrt(0.75 * 1e3 * newtons * ball_mm * (own + gel)))
            made = ball_press(ball_mm * (own + gel) / gel, touched, thickness_mm=20.0, poisson=0.485)
            depth = gel_depth_mm(made, sensor, columns, rows, (160.0, 120.0))
        writer.write(render_gel(depth, sensor, light, rng, drift=False)[..., ::-1])
    writer.release()
    lines = [f"{time:.3f},{force(time - lag_s) + rng.normal(0.0, 0.0005):.5f}" for time in np.arange(-0.5, 3.0, 0.02)]
    (folder / "gauge.csv").write_text("\n".join(["time_s,force_n", *lines]))


def test_a_video_of_a_press_with_its_gauge_gives_the_modulus_and_their_delay(run_tsis: RunTsis, tmp_path: Path) -> None:
    made = run_tsis(
        *("sensor", "new", "thick", "--like", "gelsight-mini", "--thickness-mm", "20", "--young-kpa", "150"),
        *("--young-measured", "--out", "thick.toml"),
    )
    assert made.code == 0, made.err
    gel_film(tmp_path, lag_s=0.1)
    order = ("hardness", "press.mkv", "--sensor", "thick.toml", "--radius-mm", "8", "--radius-sd-mm", "0")
    finished = run_tsis(*order, "--forces", "gauge.csv", "--force-zero-sd-n", "0", "--json")
    assert finished.code == 0, finished.err
    low, high = json.loads(finished.out)["estimate"]["parameters"]["young_kpa"]["interval_90"]
    assert low < 60.0 < high
    assert high < 2.2 * low
    told = re.search(r"lags ([+-]\d+) ms", finished.err)
    assert told
    assert float(told[1]) == pytest.approx(100.0, abs=25.0)
    without = run_tsis(*order)
    assert without.code == 2
    assert "--forces" in without.err
    forced = run_tsis(*order, "--forces", "gauge.csv", "--force-n", "0.5")
    assert forced.code == 2
    assert "--force-n must be left out with a video" in forced.err
    early = run_tsis(*order, "--forces", "gauge.csv", "--video-start-s", "-50")
    assert early.code == 2
    assert "must have readings during the film" in early.err
    assert "check the time of the film's first frame" in early.err
