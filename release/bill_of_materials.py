"""The software bill of materials, CycloneDX JSON: `make sbom`.

Covers the Python packages that a plain install of tsis and each of its extras bring, with the versions and licences
that they declare, as installed in this environment. Scope `required` is the plain install, `optional` an extra. What
lies inside wheels and packages of the system are not looked into.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
OWN = "tsis"
Bill = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What pyproject.toml asks for: requirements of the plain install, and of each extra."""

    plain: list[str]
    extras: dict[str, list[str]]

    @classmethod
    def read(cls, path: Path) -> Manifest:
        """The requirements that a pyproject.toml states."""
        project = tomllib.loads(path.read_text(encoding="utf-8"))["project"]
        extras = project["optional-dependencies"]
        # an extra that only names others of tsis brings nothing of its own
        own = {name: [text for text in texts if key(Requirement(text).name) != OWN] for name, texts in extras.items()}
        return cls(plain=project["dependencies"], extras=own)

    @property
    def direct(self) -> set[str]:
        """Names of the packages that tsis itself asks for, where this system needs them."""
        texts = [*self.plain, *(text for extra in self.extras.values() for text in extra)]
        return {key(requirement.name) for requirement in map(Requirement, texts) if applies(requirement, {""})}


def key(name: str) -> str:
    """The name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def applies(requirement: Requirement, extras: set[str]) -> bool:
    """Whether the requirement holds here for any of these extras ("" is none)."""
    return requirement.marker is None or any(requirement.marker.evaluate({"extra": extra}) for extra in extras)


def closure(requirements: list[str]) -> dict[str, set[str]]:
    """What the requirements bring, directly or through others: name -> names that it needs itself."""
    needs: dict[str, set[str]] = {}
    asked: dict[str, set[str]] = {}
    left = [(text, {""}) for text in requirements]
    while left:
        text, extras = left.pop()
        requirement = Requirement(text)
        name = key(requirement.name)
        if not applies(requirement, extras):
            continue
        wanted = {"", *requirement.extras}
        if wanted <= asked.get(name, set()):
            continue
        asked[name] = asked.get(name, set()) | wanted
        texts = metadata.distribution(name).requires or []
        needs[name] = {key(Requirement(t).name) for t in texts if applies(Requirement(t), asked[name])}
        left += [(t, asked[name]) for t in texts]
    return needs


def narrow(found: Bill, manifest: Manifest, *, version: str) -> Bill:
    """The bill of the whole environment, narrowed to what tsis brings, without addresses."""
    plain = closure(manifest.plain)
    needs = plain | closure([*manifest.plain, *(text for texts in manifest.extras.values() for text in texts)])
    components = {key(each["name"]): each for each in found["components"] if key(each["name"]) in needs}
    for name, component in components.items():
        component["scope"] = "required" if name in plain else "optional"
        component.setdefault("licenses", _declared(name))
    references = {name: component["bom-ref"] for name, component in components.items()}
    root = found["metadata"]["component"] | {"version": version}
    graph = {root["bom-ref"]: manifest.direct} | {references[name]: needs[name] for name in components}
    edges = [
        {"ref": ref, "dependsOn": sorted(references[name] for name in names if name in references)}
        for ref, names in sorted(graph.items())
    ]
    narrowed = found | {
        "components": sorted(components.values(), key=lambda each: str(each["bom-ref"])),
        "dependencies": edges,
        "metadata": found["metadata"] | {"component": root},
    }
    bill: Bill = _without_addresses(narrowed)
    return bill


def faults(bill: Bill, direct: set[str]) -> list[str]:
    """What the bill must say and does not, one sentence each."""
    named = {key(each["name"]): each for each in bill["components"]}
    missing = sorted(direct - set(named))
    found = [f"{name} must be in the bill; it is not installed: run `make sbom`, which installs it" for name in missing]
    for name, component in sorted(named.items()):
        found += [f"{name} must have its {field}" for field in ("version", "licenses") if not component.get(field)]
    if re.search(r"\bfile:|/simple/|https?://[^\"]*pypi", json.dumps(bill | {"$schema": ""})):
        found.append("the bill must hold no address of an index or of a file")
    return found


def _declared(name: str) -> list[dict[str, Any]]:
    """The licence by the older field of a package's metadata, which the generator leaves out."""
    licences = metadata.metadata(name).get_all("License") or []
    return [{"license": {"name": licence.strip(), "acknowledgement": "declared"}} for licence in licences]


def _without_addresses(value: Any) -> Any:
    """The value without external references: which index or mirror to use is the reader's choice."""
    if isinstance(value, dict):
        return {name: _without_addresses(each) for name, each in value.items() if name != "externalReferences"}
    return [_without_addresses(each) for each in value] if isinstance(value, list) else value


def _environment() -> Bill:
    command = [sys.executable, "-m", "cyclonedx_py", "environment", "--pyproject", str(ROOT / "pyproject.toml")]
    options = ["--output-reproducible", "--short-PURLs", "--no-validate", "--spec-version", "1.6"]
    done = subprocess.run([*command, *options], check=True, capture_output=True, text=True)
    bill: Bill = json.loads(done.stdout)
    return bill


def main(path: Path) -> None:
    """Write the bill, or say what it lacks and end with 1."""
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    manifest = Manifest.read(ROOT / "pyproject.toml")
    bill = narrow(_environment(), manifest, version=metadata.version(OWN))
    text = json.dumps(bill, indent=2, sort_keys=True, ensure_ascii=False) + "\n"
    invalid = JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)
    wrong = faults(bill, manifest.direct) + ([f"the bill must be valid CycloneDX 1.6: {invalid}"] if invalid else [])
    if wrong:
        raise SystemExit("\n".join(wrong))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    required = sum(each["scope"] == "required" for each in bill["components"])
    sys.stdout.write(f"{path}: {len(bill['components'])} packages, {required} of them in the plain install\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
