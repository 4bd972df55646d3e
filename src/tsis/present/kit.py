"""The validation kit on paper, and the score of a validation."""

from __future__ import annotations

import hashlib
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from tsis.present.document import envelope
from tsis.present.labels import quantity_of
from tsis.present.page import Card, Page, Table
from tsis.present.study import ends
from tsis.study.kit import KIT, MODULUS_COLUMNS, kit_moulds

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.study.kit import ValidationScore


POINTS, CODES, SPECIMENS = 10, 10, 3
SIZED = tuple(name for size in ("d / mm", "h / mm", "E / kPa") for name in (size, "low, high"))
RECIPE = (
    "Mix tissue of about 5 kPa, inclusions A of about 90 kPa and B of about 55 kPa: platinum-cured silicone with "
    "silicone oil, which keeps for months, or gelatin (about 5 % by mass for tissue, 15 to 20 % for inclusions), which "
    "lasts days in the cold under oil.",
    "Print the moulds. Cast the spheres in two clamped halves, through a needle at the seam. Measure each with a "
    "calliper in three directions.",
    "Pour tissue to the height of the sphere's lower end, let it set until it bears, lay the sphere on the middle, "
    "fill up to 30 mm. Weigh each pour: the depth follows from its volume; check it on a cut sister phantom.",
    "Cast three test cylinders or three pads from each batch, tissue, A and B, in the same hour.",
    "Write the measured diameters and depths into phantoms.csv in place of those of the recipe. Rows without sizes are "
    "blank phantoms.",
)
PROTOCOL = (
    "The maker, who reads nothing, types: tsis study new validation --truth phantoms.csv --repeats 3. The program "
    "seals the list and prints codes and a hash; the hash goes to somebody else. The maker sticks the codes on.",
    "Calibrate the probe. Two others read every code three times in the order of tsis study show, on the data sheet or "
    "in a table for tsis study import, with the ends of each 90 % interval. Undecided readings stay empty. Give nobody "
    "the folder with the seal.",
    "The maker tests the batches on the day of the readings, at their temperature, and types the points into "
    "modulus.csv: a row each, forces in N, lengths in mm, size_mm the radius of the ball or the diameter of the "
    "cylinder, phantom the phantoms of the batch between semicolons (1;2;3;4;5) or tissue. Stay below 10 % of "
    "shortening, and leave out points before contact.",
    "tsis study import, then tsis study analyse --by NAME: the seal opens once.",
    "tsis study score KIT --study validation --diameter-sd MM --depth-sd MM: the score, with the measured moduli in "
    "place of those of the recipe, and the standard uncertainties of the measured sizes.",
)


def kit_page() -> Page:
    """Recipe, phantoms, moulds, protocol and sheets to fill in."""
    points = tuple((str(number + 1), "", "", "", "", "", "") for number in range(POINTS))
    sheet = ("point", *(f"{name} {n + 1}" for n in range(SPECIMENS) for name in ("mm", "N")))
    return Page(
        title="Kit for a first physical validation",
        subtitle="ten phantoms, their moulds, a bench test of their moduli, a blinded protocol",
        cards=(
            Card(title="phantoms", value=str(len(KIT)), detail=f"{sum(not item.batch for item in KIT)} of them blank"),
            Card(title="bench tests", value="3 batches", detail="tissue, A, B; three specimens each"),
            Card(title="readings", value=f"{len(KIT)} x 2 x 3", detail="phantoms, operators, repeats"),
        ),
        tables=(
            Table(title="Recipe", columns=("step", "what to do"), values=_numbered(RECIPE)),
            Table(
                title="Phantoms",
                columns=("phantom", "batch", "diameter / mm", "depth of the top / mm", "modulus / kPa", "as measured"),
                values=tuple(
                    (item.label, item.batch or "blank", *map(_or_dash, (item.diameter_mm, item.depth_mm)), modulus, "")
                    for item in KIT
                    for modulus in [_or_dash(item.young_kpa)]
                ),
            ),
            Table(
                title="Moulds",
                columns=("file", "what to print"),
                values=tuple((name, what) for name, (_, what) in kit_moulds().items()),
            ),
            Table(title="Blinded protocol", columns=("step", "what to do"), values=_numbered(PROTOCOL)),
            *(
                Table(
                    title=f"Bench test, batch {batch}. Ball or cylinder, width, height: ________",
                    columns=sheet,
                    values=points,
                )
                for batch in ("tissue", "A", "B")
            ),
            Table(
                title="Data sheet of the readings. Operator, date, temperature: ____________",
                columns=("code", "repeat", "score", *SIZED),
                values=tuple(
                    ("", str(repeat + 1), "", *[""] * len(SIZED)) for _ in range(CODES) for repeat in range(3)
                ),
            ),
        ),
        provenance={"columns of modulus.csv": ", ".join(MODULUS_COLUMNS)},
    )


def _numbered(texts: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    return tuple((str(number), text) for number, text in enumerate(texts, start=1))


def _or_dash(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"


def kit_document(files: Mapping[str, bytes]) -> dict[str, Any]:
    """Phantoms of the kit, and the SHA-256 of its files by name."""
    hashes = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    return envelope("study kit", phantoms=[asdict(item) for item in KIT], files=hashes)


def score_page(score: ValidationScore) -> Page:
    """How often intervals held the truth, bias, detection, and the moduli of the bench."""
    counts = score.counts
    hits = "-" if counts is None else f"{counts.true_positives} of {counts.present}"
    alarms = "-" if counts is None else f"{counts.false_positives} of {counts.absent}"
    numbers = tuple(
        (
            quantity_of(item.quantity).heading,
            f"{item.hits} of {item.count}" if item.count else "-",
            f"{item.hits_widened} of {item.count}" if item.count else "-",
            "-" if item.bias is None else f"{item.bias:+.3g} ({ends(item.bias_interval, 2)})",
            _percent(item.relative_bias),
            str(item.phantoms),
        )
        for item in score.quantities
    )
    moduli = tuple(
        (
            label,
            f"{item.young_kpa:.4g} ± {item.sd_kpa:.2g}",
            f"{score.nominal[label]:.4g}" if label in score.nominal else "-",
            str(item.specimens),
            ", ".join(f"{kind} {value:.4g}" for kind, value in item.by_kind.items()),
        )
        for label, item in sorted(score.moduli.items())
    )
    return Page(
        title=f"Validation: {score.device}",
        subtitle=f"study {score.study.plan.name}, {score.study.plan.made:%Y-%m-%d}",
        cards=(
            Card(title="inclusions found", value=hits, detail=f"false alarms: {alarms}"),
            *(
                Card(
                    title=f"{quantity_of(item.quantity).label}: 90 % intervals that hold the truth",
                    value=f"{item.hits} of {item.count}" if item.count else "none given",
                    detail=f"bias {_percent(item.relative_bias)}",
                )
                for item in score.quantities
            ),
        ),
        notes=score_notes(score),
        tables=(
            Table(
                title="Readings against the truth",
                columns=("quantity", "90 % holds", "widened", "bias (95 % interval)", "relative bias", "phantoms"),
                values=numbers,
            ),
            Table(
                title="Moduli of the bench, kPa",
                columns=("phantom", "measured, sd", "sealed", "specimens", "by kind of test"),
                values=moduli,
            ),
        ),
        provenance={"sealed truth (SHA-256)": score.study.plan.commitment, "head of the log": score.study.chain.head},
    )


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:+.1%}"


def score_notes(score: ValidationScore) -> tuple[str, ...]:
    """What limits the score."""
    named = [
        (score.faults, f"Study and log differ in {score.faults} places from what was written (tsis study verify)."),
        (score.of_recipe, "Sealed diameters and depths are those of the recipe: no measured sizes were entered."),
        (score.undecided or score.unread, f"Undecided phantoms: {score.undecided}; not read: {score.unread}."),
    ]
    return (
        *(text for holds, text in named if holds),
        "The truth is that of calliper and bench test; widened intervals include its standard uncertainty, of sizes as "
        "far as it was given. "
        "First readings of a phantom by each operator count; readings of one phantom are not independent. The bias is "
        "that of readings whose value is identified; intervals count in any case.",
    )


def score_document(score: ValidationScore) -> dict[str, Any]:
    """The score as JSON values."""
    counts, names = score.counts, ("true_positives", "present", "false_positives", "absent")
    return envelope(
        "study score",
        device=score.device,
        study=score.study.plan.name,
        detection=None if counts is None else {name: getattr(counts, name) for name in names},
        undecided=score.undecided,
        unread=score.unread,
        quantities=[
            asdict(item) | {"bias_interval": None if item.bias_interval is None else list(item.bias_interval)}
            for item in score.quantities
        ],
        moduli={label: asdict(item) for label, item in score.moduli.items()},
        sizes_of_recipe=score.of_recipe,
        notes=list(score_notes(score)),
        head=score.study.chain.head,
    )
