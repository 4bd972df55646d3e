"""What accompanies a benchmark data set: its data sheet for readers, its metadata for archives."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from tsis.__about__ import RESEARCH_USE_ONLY, __version__

if TYPE_CHECKING:
    from collections.abc import Mapping

TITLE = "Simulated presses of an optical tactile probe on tissue with and without an inclusion"
LICENSE = "CC-BY-4.0"
LICENSE_URL = "https://creativecommons.org/licenses/by/4.0/"
SHEET = """# {title}

{notice}

**Why it was made.** To compare programs that read an inclusion's diameter, depth and modulus, or its presence, from
tactile images. **By whom.** The TSIS founders, by `{command}` with tsis {version}.

**What it holds.** {cases} cases, {blanks} of them without an inclusion. Of each case {frames} frames of 768 x 492
pixels, 8 bits, PNG: presses on the target and on plain tissue nearby, by the probe `{probe}`. All are **simulated**: no
person, animal or physical phantom took part. The presses are solved on a finer mesh of another order than the tables of
tsis' own estimate, with lamps traced by rays, camera noise, and gain, stiffness, force errors and pattern drawn anew in
each case; `strain` says by which mechanics (neo-Hookean where finite). Worlds: {worlds}.

| file | what it holds |
| --- | --- |
| `presses.csv` | frames: case, site (`target`, `reference`), force in N by the gauge, mm per pixel, strain |
| `frames/` | the frames, named by case |
| `calibration.json` | what a laboratory would know of the probe, with stated errors |
| `prior.json` | what the cases were drawn from |
| `truth.csv` | **do not read it before you answer**: world, diameter, depth of the top, modulus; empty in blanks |
| `datacite.json`, `codemeta.json` | metadata for archives |
| `SHA256SUMS` | hashes of all the others; `sha256sum --check SHA256SUMS` |

**Answers.** A CSV file with the columns `{columns}`; `_low` and `_high` are the ends of a 90 % interval, `presence` is
the probability of an inclusion. Leave cells empty that a program does not answer. `python -m benchmarks.data_set score
FOLDER ANSWERS.csv` scores it.

**How not to use it.** It says how a program reads this model of a press, not how it reads real frames; probe and tissue
share their equations with tsis. Do not train on these cases and report scores of them: make others with another seed.
Nothing here is for patient care.

**Licence.** {license}. **Corrections** get a new seed or version, never the same hash.
"""


def sheet(about: Mapping[str, Any]) -> str:
    """The data sheet; ``about`` fills it."""
    return SHEET.format(title=TITLE, notice=RESEARCH_USE_ONLY, version=__version__, license=LICENSE, **about)


def datacite(about: Mapping[str, Any]) -> bytes:
    """Metadata after DataCite's schema 4.5, but for the identifier, which the archive gives."""
    return _bytes(
        {
            "schemaVersion": "http://datacite.org/schema/kernel-4",
            "types": {"resourceTypeGeneral": "Dataset", "resourceType": "simulated images with truths"},
            "titles": [{"title": TITLE}],
            "creators": [{"name": "the TSIS founders", "nameType": "Organizational"}],
            "publisher": {"name": "the TSIS founders"},
            "publicationYear": 2026,
            "version": __version__,
            "language": "en",
            "formats": ["image/png", "text/csv", "application/json"],
            "sizes": [f"{about['cases']} cases, {about['frames']} frames each"],
            "rightsList": [{"rights": LICENSE, "rightsUri": LICENSE_URL, "rightsIdentifier": LICENSE}],
            "subjects": [{"subject": one} for one in ("tactile imaging", "elastography", "inverse problems")],
            "descriptions": [
                {"descriptionType": "Abstract", "description": f"{TITLE}. {RESEARCH_USE_ONLY}"},
                {"descriptionType": "Methods", "description": f"{about['command']}, worlds: {about['worlds']}"},
            ],
        }
    )


def codemeta(about: Mapping[str, Any]) -> bytes:
    """The data set and the program that made it, for codemeta and schema.org."""
    return _bytes(
        {
            "@context": "https://w3id.org/codemeta/3.0",
            "@type": "Dataset",
            "name": TITLE,
            "description": RESEARCH_USE_ONLY,
            "version": __version__,
            "license": LICENSE_URL,
            "creator": [{"@type": "Organization", "name": "the TSIS founders"}],
            "isBasedOn": {"@type": "SoftwareSourceCode", "name": "tsis", "version": __version__},
            "measurementTechnique": about["command"],
            "variableMeasured": ["diameter_mm", "depth_mm", "young_kpa", "presence"],
        }
    )


def _bytes(document: Mapping[str, Any]) -> bytes:
    return (json.dumps(document, indent=2) + "\n").encode()
