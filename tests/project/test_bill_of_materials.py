"""The bill of materials names what an installation brings, with version and licence, and no address."""

from __future__ import annotations

import copy
import json
import tomllib
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from release.bill_of_materials import Manifest, closure, faults, key, main, narrow

if TYPE_CHECKING:
    from release.bill_of_materials import Bill

ROOT = Path(__file__).parents[2]
PLAIN = ["numpy>=2", "jinja2>=3"]
EXTRAS = {"cluster": ["distributed>=2025"], "nothing": []}


def _component(name: str) -> dict[str, Any]:
    version = metadata.version(name)
    return {
        "bom-ref": f"{name}=={version}",
        "name": name,
        "version": version,
        "licenses": [{"license": {"name": "free"}}],
        "externalReferences": [{"type": "distribution", "url": f"https://registry.example/simple/{name}"}],
    }


@pytest.fixture
def bill() -> Bill:
    """Narrowed from an environment that holds more than tsis brings."""
    names = [*closure(PLAIN + EXTRAS["cluster"]), "pytest"]
    found = {
        "components": [_component(name) for name in names],
        "dependencies": [],
        "metadata": {"component": {"bom-ref": "root", "name": "tsis"}, "tools": {"components": [_component("pip")]}},
    }
    return narrow(found, Manifest(plain=PLAIN, extras=EXTRAS), version="1.2.3")


def test_only_what_tsis_brings_is_in_it(bill: Bill) -> None:
    scopes = {each["name"]: each["scope"] for each in bill["components"]}
    assert "pytest" not in scopes
    assert {name for name, scope in scopes.items() if scope == "required"} == {"numpy", "jinja2", "markupsafe"}
    assert scopes["dask"] == scopes["distributed"] == "optional"
    assert bill["metadata"]["component"]["version"] == "1.2.3"


def test_its_graph_is_that_of_the_packages(bill: Bill) -> None:
    graph = {edge["ref"]: edge["dependsOn"] for edge in bill["dependencies"]}
    assert {ref.split("==")[0] for ref in graph["root"]} == {"numpy", "jinja2", "distributed"}
    (jinja,) = (ref for ref in graph if ref.startswith("jinja2=="))
    assert graph[jinja] == [f"markupsafe=={metadata.version('markupsafe')}"]
    assert {ref for refs in graph.values() for ref in refs} <= set(graph)


def test_a_complete_bill_has_no_fault_and_no_address(bill: Bill) -> None:
    assert faults(bill, {"numpy", "jinja2", "distributed"}) == []
    assert "http" not in json.dumps(bill)


def test_what_a_bill_lacks_is_said(bill: Bill) -> None:
    assert "scipy must be in the bill" in faults(bill, {"numpy", "scipy"})[0]
    for field in ("version", "licenses"):
        bare = copy.deepcopy(bill)
        del next(each for each in bare["components"] if each["name"] == "numpy")[field]
        assert faults(bare, {"numpy"}) == [f"numpy must have its {field}"]
    result = bill | {"note": "file:///srv/wheels/numpy"}
    assert faults(result, {"numpy"}) == ["the bill must hold no address of an index or of a file"]


def test_extras_of_dependencies_are_followed_and_markers_obeyed() -> None:
    assert "psycopg-binary" in closure(["psycopg[binary]>=3.2"])
    assert "psycopg-binary" not in closure(["psycopg>=3.2"])
    assert closure(["no-such-package; python_version < '3'"]) == {}


def test_an_extra_that_only_names_others_adds_nothing() -> None:
    manifest = Manifest.read(ROOT / "pyproject.toml")
    assert manifest.extras["all"] == []
    assert {"numpy", "pydicom", "h5py", "psycopg"} <= manifest.direct
    assert "tsis" not in manifest.direct


def test_what_writes_the_bill_is_pinned() -> None:
    pytest.importorskip("cyclonedx", reason="needs cyclonedx-bom, which `make sbom` installs")
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = {key(line.split("==")[0]) for line in lines if "==" in line}
    brought = set(closure(groups["release"]))
    assert {"cyclonedx-bom", "cyclonedx-python-lib", "jsonschema", "lxml"} <= brought
    assert not brought - pinned


@pytest.mark.system
def test_the_real_bill_names_every_direct_dependency(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("cyclonedx", "harvesters", "pypylon"):
        pytest.importorskip(name, reason=f"needs {name}, which `make sbom` installs")
    path = tmp_path / "sbom.cdx.json"
    main(path)
    named = {key(each["name"]): each for each in json.loads(path.read_text(encoding="utf-8"))["components"]}
    for name in Manifest.read(ROOT / "pyproject.toml").direct:
        assert named[name]["version"] == metadata.version(name)
        assert named[name]["licenses"], name
    assert f"{len(named)} packages" in capsys.readouterr().out
