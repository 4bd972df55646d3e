"""``tsis detect``: train and apply a classifier of targets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import LARGEST_SEED, LARGEST_TARGET
from tsis.cli.options import AsJson
from tsis.cli.output import CommandResult, Out, show_result
from tsis.cli.progress import progress_bar
from tsis.cli.saving import PHANTOM, StoreDatabase, StoreFolder, StoreKind, opened
from tsis.errors import InputError, UntrustedError, import_extra
from tsis.present.page import Column, Table

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from tsis.model.phantom import Inclusion
    from tsis.records.store import Store
    from tsis.records.values import TargetRecord
    from tsis.study.classifier import Classifier, ClassifierSettings, ClassSplit, TargetEvidence, Validation


app = typer.Typer(
    name="detect",
    no_args_is_help=True,
)
MOST_LISTED = 5000  # targets per call


@app.command(epilog="Example: tsis detect train classifier.json --young-kpa 60 --none 1-8 --store lab-records")
def train(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="File of the classifier to write; it must not exist yet.")
    ],
    *,
    young_kpa: Annotated[
        float | None, typer.Option(help="The third class is stiffer than this, in kilopascals.")
    ] = None,
    diameter_mm: Annotated[float | None, typer.Option(help="And larger than this, in millimetres.")] = None,
    depth_mm: Annotated[float | None, typer.Option(help="And shallower than this, in millimetres.")] = None,
    none: Annotated[str, typer.Option(help="Numbers of the targets without an inclusion, as 4,9-20.")] = "",
    penalty: Annotated[float, typer.Option(help="Penalty of targets on the wrong side.")] = 1.0,
    folds: Annotated[int, typer.Option(help="Parts by which the probabilities are calibrated.")] = 5,
    validate: Annotated[int, typer.Option(help="Parts of a cross-validation; 0 leaves it out.", min=0, max=20)] = 5,
    seed: Annotated[int, typer.Option(help="Seed of the parts.", min=0, max=LARGEST_SEED)] = 0,
    store: StoreFolder = None,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Train a classifier on the targets of a store of phantoms whose truth is known."""
    tsis.files.result_folder.require_absent(file)
    import_extra("sklearn", feature="tsis detect", extra="study")
    split = tsis.study.classifier.ClassSplit(young_kpa=young_kpa, diameter_mm=diameter_mm, depth_mm=depth_mm)
    settings = tsis.study.classifier.ClassifierSettings(penalty=penalty, folds=folds, seed=seed)
    empty = set(_numbers("--none", none))
    readings, truth, left_out = [], list[tsis.model.phantom.Inclusion | None](), []
    with opened(store, PHANTOM, database) as records:
        summaries = records.targets()
        _require_there(empty, {summary.target.number for summary in summaries})
        with progress_bar("reading targets") as advance:
            for done, summary in enumerate(summaries):
                target = summary.target
                advance(done + 1, len(summaries))
                if target.number not in empty and not set(tsis.inclusion.prior.PARAMETERS) <= set(target.truth):
                    left_out.append(f"Target {target.number} is left out: its truth is not known.")
                    continue
                if target.number in empty and target.truth:
                    raise InputError(f"--none must list targets without an inclusion; target {target.number} has one")
                try:
                    readings.append(_evidence(records.record(target, limit=0)))
                except (InputError, UntrustedError) as error:
                    left_out.append(f"Target {target.number} is left out: {error}.")
                    continue
                true: dict[str, Any] = {
                    name: target.truth[name] for name in tsis.inclusion.prior.PARAMETERS if name in target.truth
                }
                truth.append(tsis.model.phantom.Inclusion(**true) if true else None)
    if not readings:
        raise InputError("a training needs targets with an estimate and a known truth; the store has none")
    classifier = tsis.study.classifier.train_classifier(
        tsis.study.classifier.TrainingSet.of(readings, truth, split), split, settings
    )
    validation = _validated(readings, truth, split, settings, validate)
    tsis.study.classifier.write_classifier(classifier, file)
    document = tsis.present.document.envelope(
        "detect train",
        file=str(file),
        classes=list(split.names),
        targets=len(readings),
        targets_by_class=_counts(classifier),
        validation=None if validation is None else _validation_document(validation),
    )
    tables = [_training_table(classifier)]
    if validation is not None:
        tables.append(_confusion_table(validation))
    show_result(CommandResult(document=document, tables=tuple(tables), notes=tuple(left_out)), None, as_json=as_json)


@app.command(epilog="Example: tsis detect apply classifier.json 25 26 --store lab-records")
def apply(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="File that tsis detect train wrote.")],
    numbers: Annotated[
        list[int], typer.Argument(metavar="N...", help="Numbers of targets, as tsis records list shows them.")
    ],
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Print the probability of each class for targets of a store, by their current estimates."""
    import_extra("sklearn", feature="tsis detect", extra="study")
    classifier = tsis.study.classifier.read_classifier(file)
    with opened(store, kind, database) as records:
        results = [(number, classifier.classify(_evidence_of(records, number))) for number in numbers]
    table = Table(
        title="Probabilities of the classes",
        columns=("target", *(Column(label=name, form=".3f") for name in classifier.split.names), "likeliest"),
        values=tuple((number, *item.probabilities.values(), item.likeliest) for number, item in results),
    )
    document = tsis.present.document.envelope(
        "detect apply",
        classes=list(classifier.split.names),
        targets=[
            {
                "number": number,
                "probabilities": dict(item.probabilities),
                "at_mean": dict(item.at_mean),
                "likeliest": item.likeliest,
            }
            for number, item in results
        ],
    )
    show_result(CommandResult(document=document, tables=(table,), notes=classifier.notes), out, as_json=as_json)


def _evidence_of(records: Store, number: int) -> TargetEvidence:
    try:
        return _evidence(records.record(records.target(number), limit=0))
    except (InputError, UntrustedError) as error:
        raise type(error)(f"target {number}: {error}") from error


def _evidence(record: TargetRecord) -> TargetEvidence:
    """The current estimate; `InputError` where there is none, `UntrustedError` where it has no presence to trust."""
    results = [stored.estimate for stored in record.active_estimates if stored.kind == "inclusion"]
    if not results:
        raise InputError("it has no estimate of an inclusion")
    try:
        return tsis.study.classifier.target_evidence(results[0])
    except InputError as error:
        raise InputError(str(error).rstrip(".")) from error


def _numbers(option: str, text: str) -> Iterable[int]:
    """Numbers of targets, as ``4,9-20``."""
    result: list[int] = []
    for part in filter(None, text.replace(" ", "").split(",")):
        first, _, last = part.partition("-")
        if not (first.isdecimal() and (last or first).isdecimal() and len(part) < 24):
            raise InputError(f"{option} must be numbers of targets, as 4,9-20; got {text!r:.80}")
        low, high = int(first), int(last or first)
        if not 1 <= low <= high <= LARGEST_TARGET or high - low >= MOST_LISTED:
            raise InputError(f"{option} must be ranges that ascend from 1 on; got {part!r}")
        result += range(low, high + 1)
    return result


def _require_there(numbers: set[int], present: set[int]) -> None:
    missing = sorted(numbers - present)
    if missing:
        raise InputError(f"--none must list targets of the store; there is no target {missing[0]}")


def _validated(
    readings: Sequence[TargetEvidence],
    truth: Sequence[Inclusion | None],
    split: ClassSplit,
    settings: ClassifierSettings,
    parts: int,
) -> Validation | None:
    if not parts:
        return None
    with progress_bar("cross-validating") as progress:
        return tsis.study.classifier.cross_validate(readings, truth, split, settings, folds=parts, progress=progress)


def _counts(classifier: Classifier) -> dict[str, int]:
    labels = classifier.training.labels.tolist()
    return {name: labels.count(label) for label, name in enumerate(classifier.split.names)}


def _training_table(classifier: Classifier) -> Table:
    columns = ("class", Column(label="targets"))
    return Table(title="Training targets", columns=columns, values=tuple(_counts(classifier).items()))


def _confusion_table(validation: Validation) -> Table:
    names = validation.split.names
    interval = validation.accuracy.interval()
    title = (
        f"Cross-validation: right {validation.accuracy.value:.0%}, {100 * interval.level:g} % interval "
        f"{interval.low:.0%} to {interval.high:.0%}"
    )
    rows = tuple((name, *row) for name, row in zip(names, validation.confusion.tolist(), strict=True))
    return Table(title=title, columns=("true class", *(Column(label=f"called {name}") for name in names)), values=rows)


def _validation_document(validation: Validation) -> dict[str, Any]:
    interval = validation.accuracy.interval()
    return {
        "confusion": validation.confusion.tolist(),
        "accuracy": validation.accuracy.value,
        "accuracy_interval": [interval.low, interval.high],
        "log_loss": validation.log_loss,
        "brier": validation.brier,
    }
