"""``--probe`` and ``--prior``: a file in place of an entry of the catalog, and what is refused."""

from __future__ import annotations

import json
import tomllib
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tsis
from tsis.calibration.file import read_calibration
from tsis.catalog.phantoms import load_phantom
from tsis.catalog.priors import default_prior_toml, inclusion_prior_toml, parse_prior, read_prior_file
from tsis.catalog.probes import list_probes, load_probe, probe_toml
from tsis.cli.options import calibrated_probe, chosen_prior, chosen_probe, other_priors, read_probe
from tsis.errors import FileInputError, InputError, NotCalibratedError, UnknownNameError
from tsis.hardness.posterior import HardnessPrior
from tsis.inclusion import InclusionPrior, estimate, load_prior
from tsis.inclusion.budget import PriorShift, prior_sensitivity, with_prior_sensitivity
from tsis.instrument.image_files import read_image
from tsis.mechanics import press
from tsis.model.estimate import Estimate
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


SURE = "presence = 0.9\npoisson_sd = 0.02\n"  # another prior over the same box, whose surrogate is there


@pytest.mark.parametrize(("kind", "prior"), [("inclusion", InclusionPrior()), ("hardness", HardnessPrior())])
def test_the_shipped_file_is_the_default_prior_with_every_key(kind: str, prior: Any, tmp_path: Path) -> None:
    text = default_prior_toml(kind)
    assert set(tomllib.loads(text)) == set(asdict(prior))
    (tmp_path / "prior.toml").write_text(text, encoding="utf-8")
    assert read_prior_file(tmp_path / "prior.toml", type(prior)) == prior
    with pytest.raises(UnknownNameError, match="no prior is called 'size'"):
        default_prior_toml("size")


@pytest.mark.parametrize("command", ["examine", "demo", "design", "hardness"])
def test_commands_show_the_prior_to_start_from(run_tsis: RunTsis, command: str) -> None:
    finished = run_tsis(command, "--show-prior")
    assert finished.code == 0, finished.err
    assert finished.out == default_prior_toml("hardness" if command == "hardness" else "inclusion")
    assert "--prior" in run_tsis(command, "--help").out


@pytest.mark.slow
def test_the_demo_estimates_with_the_prior_of_the_file(run_tsis: RunTsis, tmp_path: Path) -> None:
    """The estimate is that of the call in Python with `InclusionPrior`, on the frames that the demo wrote."""
    (tmp_path / "mine.toml").write_text(SURE)
    press = ("demo", "--strain", "small", "--phantom", "size-8", "--seed", "713", "--json")
    results = {}
    for name, options in {"mine": ("--prior", "mine.toml"), "default": ()}.items():
        finished = run_tsis(*press, "--out", name, *options)
        assert finished.code == 0, finished.err
        results[name] = json.loads(finished.out)["estimate"]
    assert results["mine"]["provenance"]["prior"] == json.loads(
        json.dumps(asdict(InclusionPrior(**tomllib.loads(SURE))))
    )
    assert "probability 0.9" in results["mine"]["prior"]
    assert results["mine"]["parameters"] != results["default"]["parameters"]
    again = {}
    known = read_calibration(tmp_path / "mine" / "calibration.json").response
    assert known is not None
    for kind in ("target", "reference"):
        again[kind] = [
            read_image(tmp_path / "mine" / f"{kind}-{force:g}N.png", mm_per_pixel=(0.0336, 0.0392), force_n=force)
            for force in (0.5, 1.0)
        ]
    expected = estimate(
        again["target"],
        probe=tsis.load_probe("tsis-domed"),
        calibration=known,
        reference=again["reference"],
        prior=InclusionPrior(presence=0.9, poisson_sd=0.02),
        strain="small",
    )
    for name, samples in expected.samples.items():
        found = results["mine"]["parameters"][name]
        assert found["interval_90"] == pytest.approx(np.quantile(samples, [0.05, 0.95]))
        assert found["mean"] == (pytest.approx(samples.mean()) if expected.identified(name) else None)


def test_the_design_is_judged_by_the_prior_of_the_file(run_tsis: RunTsis, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("offset_sd_mm = 0.0\n")
    command = ("design", "--probe", "tsis-2011", "--force-n", "1", "--compare", "reference", "--json")
    errors = []
    for options in (("--prior", "mine.toml"), ()):
        finished = run_tsis(*command, *options)
        assert finished.code == 0, finished.err
        document = json.loads(finished.out)
        errors.append(document["designs"][0]["expected_rmse"])
    assert errors[0] != errors[1], "an inclusion that is known to lie on the axis is another question"
    assert errors[0]["diameter_mm"] <= errors[1]["diameter_mm"] + 1e-9


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("diametre_mm = [1, 15]", "no value of the prior is called 'diametre_mm'; did you mean 'diameter_mm'?"),
        ("diameter_mm = [5, 2]", "the high end of diameter_mm must"),
        ("diameter_mm = 5.0", "diameter_mm"),
        ("diameter_mm = [5, 'six']", "diameter_mm must be a number, or a range as [1.0, 15.0]"),
        ("presence = true", "presence must be a number"),
        ("presence = 2.0", "presence must lie in [0.001, 0.999]"),
        ("young_kpa = [2, 120]", "young_kpa must lie above tissue_young_kpa"),
        ("thickness_mm = 20.0", "the largest depth_mm + diameter_mm must be less than thickness_mm"),
        ("presence = ", "a prior must be TOML"),
        ("[prior]\npresence = 0.5", "no value of the prior is called 'prior'"),
        ("presence" + ".a" * 40 + " = 1", "a prior must be TOML with keys of at most 16 parts"),
    ],
)
def test_what_is_no_prior_is_refused_by_name(run_tsis: RunTsis, tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "mine.toml").write_text(text)
    finished = run_tsis("demo", "--strain", "small", "--prior", "mine.toml")
    assert finished.code == 2
    assert finished.err.startswith("Error: 'mine.toml': ")
    assert message in finished.err
    assert finished.err.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"mine.toml"}
    with pytest.raises(FileInputError):
        read_prior_file(tmp_path / "mine.toml", InclusionPrior)


def test_a_prior_without_an_estimate_or_a_file_is_refused(run_tsis: RunTsis, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(SURE)
    (tmp_path / "press.png").write_bytes(b"not read: the calibration is asked for first")
    finished = run_tsis("examine", "press.png", "--prior", "mine.toml")
    assert finished.code == 2
    assert "an estimate needs the calibration of the probe" in finished.err
    for command in ("demo", "design", "hardness"):
        finished = run_tsis(command, "--prior", "missing.toml")
        assert finished.code == 2
        assert "missing.toml" in finished.err


def test_the_hardness_is_estimated_with_the_prior_of_the_file(
    run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Any] = []

    class Rig:
        calibration = SimpleNamespace(name="rig")

        def __init__(self, *_: object, **__: object) -> None: ...

        def press_path(self, *_: object, **__: object) -> list[Any]:
            return []

    def estimated(*_: object, prior: HardnessPrior, **__: object) -> None:
        given.append(prior)
        raise InputError("enough")

    monkeypatch.setattr("tsis.virtual.direct_contact.DirectContactRig", Rig)
    monkeypatch.setattr("tsis.calibration.file.ProbeCalibration", lambda **_: None)
    monkeypatch.setattr("tsis.calibration.file.calibration_bytes", lambda _: b"")
    monkeypatch.setattr("tsis.hardness.estimate", estimated)
    (tmp_path / "mine.toml").write_text("young_kpa = [5.0, 2000.0]\npoisson = [0.48, 0.495]\n")
    for options in (("--prior", "mine.toml"), ()):
        assert run_tsis("hardness", "--demo", *options).err == "Error: enough\n"
    assert given == [HardnessPrior(young_kpa=(5.0, 2000.0), poisson=(0.48, 0.495)), HardnessPrior()]


@pytest.mark.parametrize("name", ["phantom-2011", "breast-ex-vivo", "wide"])
def test_a_shipped_prior_cites_its_source_and_is_named_in_results(name: str) -> None:
    text = inclusion_prior_toml(name)
    assert "Source" in text
    prior = load_prior(name)
    assert chosen_prior(name) == prior
    assert str(prior).startswith(f"{name}: ")
    assert replace(prior, name="") == parse_prior(text, InclusionPrior)
    assert name not in other_priors(prior)
    assert len(other_priors(prior)) == 2
    assert str(chosen_prior(None)).startswith("phantom-2011: ")


def test_a_contrast_is_a_modulus_over_that_of_the_tissue() -> None:
    prior = parse_prior("contrast = [1.5, 13.0]\ntissue_young_kpa = 4.0", InclusionPrior)
    assert prior.young_kpa == (6.0, 52.0)
    assert parse_prior("contrast = [8, 24]", InclusionPrior).young_kpa == (40.0, 120.0)
    with pytest.raises(InputError, match="must state young_kpa or contrast, not both"):
        parse_prior("contrast = [2.0, 9.0]\nyoung_kpa = [40.0, 60.0]", InclusionPrior)
    with pytest.raises(UnknownNameError, match="contrast"):
        parse_prior("contrast = [2.0, 9.0]", HardnessPrior)
    with pytest.raises(InputError, match="name must be a str"):
        parse_prior("name = 3", InclusionPrior)


def test_other_priors_move_an_answer_by_the_difference_of_the_means(monkeypatch: pytest.MonkeyPatch) -> None:
    def fake(images: object, *, prior: InclusionPrior, **call: object) -> Estimate:
        if prior.presence == 0.3:
            raise InputError("too dark")
        mean = 8.0 if prior.presence == 0.9 else 7.0
        return Estimate(samples={"diameter_mm": [mean - 1, mean, mean + 1]}, prior_sd={"diameter_mm": 4.0})

    monkeypatch.setattr("tsis.inclusion.budget.estimate", fake)
    monkeypatch.setattr("tsis.inclusion.budget.PARAMETERS", ("diameter_mm",))
    own = fake([], prior=InclusionPrior())
    priors = {"sure": InclusionPrior(presence=0.9), "dim": InclusionPrior(presence=0.3)}
    shifts = prior_sensitivity(own, [], priors, prior=InclusionPrior())
    assert shifts[0].shift_sd["diameter_mm"] == pytest.approx(1 / np.std([6, 7, 8]))
    assert with_prior_sensitivity(own, shifts).notes == (
        "Under other priors: sure: diameter +1.2 sd; dim: no estimate (too dark).",
    )


def test_an_untrusted_answer_keeps_its_cures_beside_the_line_on_other_priors() -> None:
    samples, prior_sd = {"diameter_mm": [6.0, 7.0, 8.0]}, {"diameter_mm": 4.0}
    flags = ("too_strong", "diameter_mm_not_identified")
    notes = ("Press with at most 0.5 N.", "The diameter is 7 mm or not.")
    own = Estimate(samples=samples, prior_sd=prior_sd, trusted=False, flags=flags, notes=notes)
    shown = with_prior_sensitivity(own, [PriorShift(name="wide", shift_sd={}, reason="not compared")])
    assert shown.printed_notes == ("Press with at most 0.5 N. Under other priors: wide: not compared.",)
    assert (shown.flags, len(shown.notes)) == (flags, len(notes))
    bare = Estimate(samples=samples, prior_sd=prior_sd, trusted=False)
    assert with_prior_sensitivity(bare, []) is bare
