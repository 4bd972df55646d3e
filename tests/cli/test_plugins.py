"""Plug-ins by entry points: the example package, laid out as an installer does, and broken ones."""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.records.sample import sample_record

import tsis
from tsis.errors import InputError, PluginError, UnknownNameError
from tsis.plugins import PLUGIN_KINDS, find_plugins, load_plugin

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tests.cli.conftest import RunTsis

EXAMPLE = Path(__file__).parents[2] / "examples" / "plug-ins"


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Lays a package of one module with its metadata on the path."""
    laid: list[str] = []

    def lay(name: str, groups: dict[str, dict[str, str]], module: str, text: str) -> None:
        folder = tmp_path / name
        metadata = folder / f"{name.replace('-', '_')}-1.0.dist-info"
        metadata.mkdir(parents=True)
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        entries = [
            "\n".join([f"[{group}]", *(f"{key} = {value}" for key, value in values.items())])
            for group, values in groups.items()
        ]
        (metadata / "entry_points.txt").write_text("\n".join(entries) + "\n")
        (folder / f"{module}.py").write_text(text)
        monkeypatch.syspath_prepend(str(folder))
        find_plugins.cache_clear()
        laid.append(module)

    yield lay
    for module in laid:
        sys.modules.pop(module, None)
    find_plugins.cache_clear()


@pytest.fixture
def example(install: Callable[..., None]) -> None:
    """The example package under examples/, with the entry points of its own pyproject.toml."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    text = (EXAMPLE / "tsis_example_plug_ins.py").read_text()
    install(project["name"], project["entry-points"], "tsis_example_plug_ins", text)


@pytest.mark.usefixtures("example")
def test_the_example_offers_one_of_each_kind() -> None:
    assert all(len(find_plugins(kind)) == 1 for kind in PLUGIN_KINDS)
    assert {plugin.package for kind in PLUGIN_KINDS for plugin in find_plugins(kind).values()} == {
        "tsis-example-plug-ins 1.0"
    }


@pytest.mark.usefixtures("example")
def test_a_camera_is_searched_and_connected() -> None:
    (found,) = tsis.instrument.discovery.find_cameras(["ramp"]).cameras
    camera = tsis.instrument.discovery.connect(found.spec)
    assert isinstance(camera, tsis.instrument.camera.Camera)
    camera.open()
    camera.start()
    assert [int(frame.pixels[0, 0]) for frame in camera.frames()] == [0, 1, 2]
    assert "ramp" in tsis.instrument.discovery.live_sources()


@pytest.mark.usefixtures("example")
def test_a_probe_is_loaded_by_name_and_presses() -> None:
    probe = tsis.load_probe("soft-block")
    assert (probe.name, probe.thickness_mm) == ("soft-block", 8.0)
    assert tsis.catalog.probes.list_probes()[-1] == "soft-block"
    phantom = tsis.Phantom(young_kpa=5.0, poisson=0.49, thickness_mm=30.0)
    field = tsis.mechanics.press(probe, phantom, force_n=0.5)
    assert field.approach_mm > 0


@pytest.mark.usefixtures("example")
def test_a_gauge_is_read_beside_the_camera() -> None:
    log = tsis.instrument.force_log.connected_gauge("dead-weight:0.75")
    try:
        assert {reading.force_n for reading in log.readings()} == {0.75}
    finally:
        log.stop()


@pytest.mark.slow
@pytest.mark.usefixtures("example")
def test_a_matching_method_is_judged_as_those_of_tsis() -> None:
    source = np.random.default_rng(5).normal(size=(40, 2))
    target = source @ [[1.1, 0.1], [0.0, 0.9]] + [3.0, -1.0]
    registration = tsis.matching.register(source, target, method="affine")
    assert registration.reliable
    np.testing.assert_allclose(registration.moved, target, atol=1e-9)
    unrelated = np.random.default_rng(6).normal(size=(40, 2))
    assert not tsis.matching.register(source, unrelated, method="affine").reliable


@pytest.mark.usefixtures("example")
def test_an_exporter_writes_a_form(tmp_path: Path) -> None:
    record, path = sample_record(), tmp_path / "target.forces"
    assert tsis.present.records.export_endings()["forces"] == ".forces"
    tsis.present.records.write_form("forces", record, path, identified=False)
    assert path.read_text().splitlines()[1:] == [str(press.force_n) for press in record.presses]


@pytest.mark.usefixtures("example")
def test_doctor_names_plug_ins(run_tsis: RunTsis) -> None:
    findings = {item["what"]: item for item in json.loads(run_tsis("doctor", "--no-cameras", "--json").out)["findings"]}
    assert findings["plug-in affine"]["detail"] == "tsis-example-plug-ins 1.0, matching"


def test_a_broken_plug_in_is_named_and_the_rest_goes_on(
    install: Callable[..., None], run_tsis: RunTsis, tmp_path: Path
) -> None:
    groups = {
        "tsis.cameras": {"dead": "broken_one:absent", "half": "broken_one:half"},
        "tsis.exporters": {"failing": "broken_one:fails", "number": "broken_one:half"},
        "tsis.probes": {"nothing": "broken_one:nothing"},
    }
    text = "half = 3\ndef fails(record, path):\n    raise ValueError('no\\nluck')\ndef nothing():\n    return None\n"
    install("broken", groups, "broken_one", text)
    missing = tsis.instrument.discovery.find_cameras(["dead", "half"]).missing
    assert "the plug-in dead of broken 1.0 must be importable from broken_one" in missing["dead"]
    assert "the plug-in half of broken 1.0 must be an object with find_cameras_here()" in missing["half"]
    with pytest.raises(PluginError, match=r"exporter failing of broken 1.0 failed: no luck"):
        tsis.present.records.write_form("failing", sample_record(), tmp_path / "new", identified=False)
    assert list(tmp_path.glob("new*")) == []
    with pytest.raises(PluginError, match=r"plug-in number of broken 1.0 must be a function"):
        load_plugin("exporters", "number")
    with pytest.raises(PluginError, match=r"nothing of broken 1.0 must return a tsis.Probe; got NoneType"):
        tsis.load_probe("nothing")
    finished = run_tsis("doctor", "--no-cameras", "--json")
    assert finished.code == 0
    states = {item["what"]: item["state"] for item in json.loads(finished.out)["findings"]}
    assert states["plug-in dead"] == "absent"


def test_names_of_tsis_cannot_be_replaced(install: Callable[..., None]) -> None:
    groups = {"tsis.probes": {"tsis-2011": "thief:other"}, "tsis.cameras": {"opencv": "thief:other"}}
    install("thief", groups, "thief", "def other():\n    raise RuntimeError\n")
    assert tsis.load_probe("tsis-2011").thickness_mm == 10.0
    assert tsis.catalog.probes.list_probes().count("tsis-2011") == 1
    assert tsis.instrument.discovery.live_sources().count("opencv") == 1


def test_two_packages_of_one_name_take_turns_by_the_alphabet(install: Callable[..., None]) -> None:
    for package in ("zeta", "alpha"):
        install(package, {"tsis.probes": {"same": f"{package}_probes:{package}"}}, f"{package}_probes", "")
    assert find_plugins("probes")["same"].package == "alpha 1.0"


def test_an_unknown_name_is_refused_with_plug_ins_installed() -> None:
    with pytest.raises(UnknownNameError):
        tsis.load_probe("tsis-2012")
    with pytest.raises(InputError, match="kind of plug-in"):
        find_plugins("lenses")
