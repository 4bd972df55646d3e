"""Bundles in memory, so that thousands of them can be forged."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

from tsis.files.json_values import to_json_value
from tsis.records.target import _write, sealed_bytes
from tsis.records.values import estimate_to_json

if TYPE_CHECKING:
    from tsis.records.values import TargetRecord


class Memory:
    def __init__(self, files: dict[str, bytes]) -> None:
        self.files = files

    def sizes(self) -> dict[str, int]:
        return {name: len(content) for name, content in self.files.items()}

    def read(self, name: str, most: int) -> bytes:
        return self.files[name][: most + 1]


def files_of(dossier: TargetRecord) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    _write(dossier, found.__setitem__)
    return found


def sealed(files: dict[str, bytes]) -> dict[str, bytes]:
    """The files with a manifest that fits them, as a forger would make it."""
    manifest = json.loads(files["manifest.json"])
    manifest.pop("sha256")
    manifest["files"] = {
        name: {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
        for name, content in sorted(files.items())
        if name != "manifest.json"
    }
    return files | {"manifest.json": sealed_bytes(manifest)}


def plain(dossier: TargetRecord) -> Any:
    """All of a dossier but its frames."""
    return [
        to_json_value(dossier.target),
        [to_json_value(press) for press in dossier.presses],
        [estimate_to_json(stored) for stored in dossier.estimates],
        [{name: values.tolist() for name, values in each.estimate.samples.items()} for each in dossier.estimates],
        sorted(dossier.calibrations),
    ]
