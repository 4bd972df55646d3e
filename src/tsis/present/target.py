"""The page of a target, without the identity of a subject."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC
from typing import TYPE_CHECKING, Any

from tsis.__about__ import __version__
from tsis.calibration.guard.limits import GUARD_FLAGS
from tsis.catalog.probes import load_probe
from tsis.errors import InputError, TsisError, UnknownNameError
from tsis.hardness.flags import HARDNESS_FLAGS
from tsis.imaging.corrections import subtract_background
from tsis.inclusion import InclusionPrior
from tsis.inclusion.flags import INCLUSION_FLAGS
from tsis.inclusion.frames import ring_edges
from tsis.mapping.flags import MAP_FLAGS
from tsis.mapping.lump_map import LumpMap
from tsis.model.estimate import INTERVAL_LEVEL, Estimate
from tsis.present.calibration import content_rows
from tsis.present.hardness import HARDNESS, estimate_cards, estimate_messages_of, hardness_rows, modulus_picture
from tsis.present.images import change_picture, force_of, frame_picture, profile_picture, sheet_picture, surface_picture
from tsis.present.inclusion import estimate_table, marginals_picture, trade_off_picture
from tsis.present.labels import counted, quantity_of
from tsis.present.lump_map import lump_map_page, lumps_text
from tsis.present.page import Card, Page, Table

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from datetime import datetime

    from tsis.model.flag import Flag
    from tsis.model.image import TactileImage
    from tsis.present.page import Picture
    from tsis.records.values import StoredEstimate, StoredMap, StoredPress, TargetRecord

    Result = StoredEstimate | StoredMap


MOST_FRAMES, MOST_PROFILES = 12, 10  # in a figure
ORDER = ("target", "ball", "plain", "untouched")  # priority of the roles for the large picture
REFERENCES = ("plain", "untouched")
GROUPS = {"target": "target", "ball": "known ball", "plain": "plain tissue"}
CHANGES = {
    "plain": ("What the inclusion adds", "the press on plain tissue whose force is nearest"),
    "untouched": ("What the touch changed", "the frame of the untouched probe"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Gallery:
    """Pictures, and a message for each that could not be drawn."""

    pictures: tuple[Picture, ...] = ()
    notes: tuple[str, ...] = ()

    def __add__(self, other: Gallery) -> Gallery:
        """The concatenation of both."""
        return Gallery(pictures=self.pictures + other.pictures, notes=self.notes + other.notes)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameWithRole:
    """A readable frame, and the role of its press."""

    role: str
    image: TactileImage


def target_gallery(record: TargetRecord) -> Gallery:
    """All pictures of the frames, the active estimates and the active map."""
    frames, unread = _frames(record)
    gallery = unread + _posteriors(record) + _strongest(frames) + _profiles(record, frames)
    if len(frames) > 1:
        gallery += Gallery(pictures=(sheet_picture([(frame.role, frame.image) for frame in frames]),))
    return gallery


def _frames(record: TargetRecord) -> tuple[list[FrameWithRole], Gallery]:
    """Frames in the order of their presses, of many only those of the estimates, and messages on unreadable ones."""
    used = {press for stored in record.active_results for press in stored.presses}
    numbered = list(enumerate(record.presses, 1))
    chosen = sorted(numbered, key=lambda pair: (pair[1].id not in used, pair[0]))[:MOST_FRAMES]
    frames, notes = [], []
    for number, press in sorted(chosen, key=lambda pair: pair[0]):
        try:
            image = replace(record.image(press), name=press.name or f"press {number}")
        except TsisError as error:
            notes.append(f"The frame of press {number} cannot be shown: {error}.")
        else:
            frames.append(FrameWithRole(role=press.role, image=image))
    if len(numbered) > len(chosen):
        notes.append(f"The pictures show {len(chosen)} of {len(numbered)} presses.")
    return frames, Gallery(notes=tuple(notes))


def _posteriors(record: TargetRecord) -> Gallery:
    return sum((_posterior(record, stored) for stored in newest_first(record)), Gallery())


def _map_page(found: LumpMap) -> Page:
    """The parts of a map on the page of its target."""
    return lump_map_page(found, title="", subtitle="")


def _posterior(record: TargetRecord, stored: Result) -> Gallery:
    if not stored.estimate.trusted:
        return Gallery()
    if isinstance(stored.estimate, LumpMap):
        return Gallery(pictures=_map_page(stored.estimate).pictures)
    estimate, truth = stored.estimate, record.target.truth
    if stored.kind == "hardness":
        return Gallery(pictures=(modulus_picture(estimate, truth.get("young_kpa")),))
    joint = (trade_off_picture(estimate, truth),) if len(estimate.names) > 1 else ()
    prior = _prior(stored)
    if prior is None:
        return Gallery(pictures=joint, notes=("The stored prior has no form in which the posteriors can be drawn.",))
    return Gallery(pictures=(marginals_picture(estimate, prior, truth), *joint))


def _prior(stored: Result) -> InclusionPrior | None:
    """The prior of the estimate, or None where the record has another kind of prior."""
    prior, estimate = stored.estimate.provenance.get("prior") or stored.options.get("prior") or {}, stored.estimate
    if not isinstance(prior, Mapping) or not isinstance(estimate, Estimate):
        return None
    if not all(hasattr(InclusionPrior, name) for name in estimate.names):
        return None
    fields: dict[str, Any] = {
        str(name): tuple(value) if isinstance(value, list) else value for name, value in prior.items()
    }
    try:
        return InclusionPrior(**fields)
    except (InputError, TypeError):
        return None


def _strongest(frames: list[FrameWithRole]) -> Gallery:
    """The press of the highest force of the first role in `ORDER`, and its change."""
    if not frames:
        return Gallery()
    shown = max(frames, key=lambda frame: (-ORDER.index(frame.role), force_of(frame.image)))
    pictures = Gallery(pictures=(frame_picture(shown.image),))
    if shown.role not in ("target", "ball"):
        return pictures
    return pictures + _change(shown.image, [frame for frame in frames if frame.role in REFERENCES])


def _change(target: TactileImage, references: list[FrameWithRole]) -> Gallery:
    def distance(frame: FrameWithRole) -> tuple[int, float]:
        return REFERENCES.index(frame.role), abs(force_of(frame.image) - force_of(target))

    near = min(references, key=distance, default=None)
    signal, pictures, notes = target, [], []
    if near is not None:
        title, what = CHANGES[near.role]
        try:
            signal = subtract_background(target, near.image)
        except InputError as error:
            notes.append(f"{target.name} cannot be compared with {near.image.name}: {error}.")
        else:
            caption = f"{target.name} minus {near.image.name}, {what}; outline and centroid in white."
            pictures.append(change_picture(signal, title=title, caption=caption))
    if signal.mm_per_pixel is not None and min(signal.grey.shape) > 1:
        pictures.append(surface_picture(signal))
    return Gallery(pictures=tuple(pictures), notes=tuple(notes))


def _profiles(record: TargetRecord, frames: list[FrameWithRole]) -> Gallery:
    """Ring means, where probe and scale are known."""
    scaled = [frame for frame in frames if frame.role in GROUPS and frame.image.mm_per_pixel is not None]
    if not scaled:
        return Gallery()
    name = _probe(record)
    try:
        edges = ring_edges(load_probe(name))
    except UnknownNameError:
        message = f"the catalog has no probe {name}" if name else "nobody wrote down which probe pressed"
        return Gallery(notes=(f"Profiles in rings are left out: {message}.",))
    scaled = sorted(scaled, key=lambda frame: -force_of(frame.image))[:MOST_PROFILES]
    groups = {text: [frame.image for frame in scaled if frame.role == role] for role, text in GROUPS.items()}
    rests = any(stored.kind == "inclusion" for stored in record.active_estimates)
    title = "The profiles that the estimate rests on" if rests else "Profiles"
    return Gallery(pictures=(profile_picture(groups, edges, title=title),))


def _probe(record: TargetRecord) -> str:
    if record.active_estimates:  # the first is of the inclusion where there is one, which uses profiles
        return record.active_estimates[0].probe
    return next((press.probe for press in record.presses if press.probe), "")


MAP = "map"  # kind of a stored map
IDENTITY_NOTE = (
    "This is a subject: the page shows only the pseudonym. Notes, settings, file names, and probes and flags unknown "
    "to tsis are hidden."
)


def without_identity(record: TargetRecord) -> TargetRecord:
    """The record of a phantom, or the de-identified record of a subject with label, number and times."""
    if record.target.kind != "subject":
        return record
    from tsis.records.deidentification import deidentified  # slow to import

    result = deidentified(record)
    presses = {press.id: f"press {number}" for number, press in enumerate(result.presses, 1)}
    names = {stored.id: f"estimate {number}" for number, stored in enumerate(result.estimates, 1)}
    names |= {stored.id: f"map {number}" for number, stored in enumerate(result.maps, 1)}
    return replace(
        result,
        target=replace(result.target, id="not told", name=record.target.name),
        presses=tuple(replace(press, id=presses[press.id]) for press in result.presses),
        estimates=tuple(replace(stored, **_renamed(stored, presses, names)) for stored in result.estimates),
        maps=tuple(replace(stored, **_renamed(stored, presses, names)) for stored in result.maps),
    )


def _renamed(stored: Result, presses: dict[str, str], names: dict[str, str]) -> dict[str, Any]:
    return {
        "id": names[stored.id],
        "supersedes": names.get(stored.supersedes, "another") if stored.supersedes else None,
        "presses": tuple(presses.get(press, "another press") for press in stored.presses),
    }


MOST_NAMED = 12  # presses in a message
SHORT = 12  # shown digits of a SHA-256 or an identity


def time_text(when: datetime) -> str:
    """Text of a time in UTC."""
    return f"{when.astimezone(UTC):%Y-%m-%d %H:%M:%S}"


def roles(presses: Sequence[StoredPress]) -> str:
    """Number of presses of each role."""
    from tsis.records.values import ROLE_NAMES  # slow to import

    counts = Counter(press.role for press in presses)
    return ", ".join(f"{counts[role]} {text}" for role, text in ROLE_NAMES.items() if counts[role])


def newest_first(record: TargetRecord) -> tuple[Result, ...]:
    """The active estimates and the active map, the newest first."""
    return tuple(sorted(record.active_results, key=lambda stored: stored.made, reverse=True))


def heading(record: TargetRecord, stored: Result, title: str) -> str:
    """A title, with the kind of the result where there are several active ones."""
    return f"{title} ({stored.kind})" if len(record.active_results) > 1 else title


def result_messages(stored: Result) -> tuple[str, ...]:
    """Messages on an estimate or a map, the most important first."""
    return stored.estimate.notes if isinstance(stored.estimate, LumpMap) else estimate_messages_of(stored)


def result_flags(stored: Result) -> Mapping[str, Flag]:
    """The flags that an estimate or a map of this kind can have."""
    return {HARDNESS: HARDNESS_FLAGS, MAP: MAP_FLAGS}.get(stored.kind, INCLUSION_FLAGS)


def stale_notes(record: TargetRecord) -> tuple[str, ...]:
    """A message for each current result whose presses were edited since; ``record`` is the one of the store."""
    from tsis.records.staleness import stale_results  # loads the libraries of records

    return tuple(result.message(numbered=True) for result in stale_results(record))


def target_notes(record: TargetRecord) -> tuple[str, ...]:
    """All messages, those of the active estimates first."""
    return (
        *_estimate_notes(record),
        *_flag_notes(record),
        *_gap_notes(record),
        *(f"Left out: {message}." for message in record.damaged),
        *((f"Note: {record.target.note}",) if record.target.note else ()),
        *((IDENTITY_NOTE,) if record.target.kind == "subject" else ()),
    )


def _estimate_notes(record: TargetRecord) -> tuple[str, ...]:
    result = newest_first(record)
    if not result:
        return ("Nothing was estimated from these presses yet.",) if record.presses else ("Nothing was recorded yet.",)
    messages = []
    for stored in result:
        sentences = (*result_messages(stored), origin(stored), *_coverage(record, stored))
        messages += [f"Of the {stored.kind}: {message}" if len(result) > 1 else message for message in sentences]
    return tuple(messages)


def origin(stored: Result) -> str:
    """Inputs, time and code of an estimate or a map."""
    version = f"tsis {stored.environment['tsis']}" if "tsis" in stored.environment else "an unknown version of tsis"
    again = f" It replaces {stored.supersedes[:SHORT]}." if stored.supersedes else ""
    done, presses = "Mapped" if stored.kind == MAP else "Estimated", counted(len(stored.presses), "press")
    return (
        f"{done} {time_text(stored.made)} UTC by {version} from {presses} of probe "
        f"{stored.probe or 'not named'} with calibration {stored.calibration[:SHORT]}.{again}"
    )


def _coverage(record: TargetRecord, stored: Result) -> tuple[str, ...]:
    held, what = {press.id for press in record.presses}, "map" if stored.kind == MAP else "estimate"
    left, gone = len(held.difference(stored.presses)), len(set(stored.presses).difference(held))
    sentences = [f"The {what} does not rest on {counted(left, 'other press')} of this target."] if left else []
    if gone:
        sentences.append(f"The store no longer shows {counted(gone, 'press')} that the {what} rests on.")
    return tuple(sentences)


def _flag_notes(record: TargetRecord) -> tuple[str, ...]:
    """A message for each flag of the press guard, with its presses and its meaning."""
    raised: dict[str, list[int]] = {}
    for number, press in enumerate(record.presses, 1):
        for flag in press.flags:
            raised.setdefault(flag, []).append(number)
    return tuple(
        f"{_numbered(numbers)} flagged {flag}: "
        f"{GUARD_FLAGS[flag].means if flag in GUARD_FLAGS else 'no flag of the press guard; somebody wrote it down'}."
        for flag, numbers in raised.items()
    )


def _gap_notes(record: TargetRecord) -> tuple[str, ...]:
    """Messages on missing measurements."""
    numbered = list(enumerate(record.presses, 1))
    pressed = [(number, press) for number, press in numbered if press.role != "untouched"]
    gaps = {
        "without a measured force": [number for number, press in pressed if press.force_n is None],
        "without a scale, so that lengths are in pixels": [n for n, press in numbered if press.mm_per_pixel is None],
        "without a calibration": [number for number, press in numbered if press.calibration is None],
    }
    return tuple(f"{_numbered(numbers)} {what}." for what, numbers in gaps.items() if numbers)


def _numbered(numbers: Sequence[int]) -> str:
    if len(numbers) == 1:
        return f"Press {numbers[0]} is"
    if len(numbers) > MOST_NAMED:
        return f"{len(numbers)} presses, the first of them {numbers[0]}, are"
    return f"Presses {', '.join(map(str, numbers[:-1]))} and {numbers[-1]} are"


def target_tables(record: TargetRecord) -> tuple[Table, ...]:
    """All tables with content."""
    return (
        *_result(record),
        *_presses(record),
        *(
            Table(
                title=f"Calibration {calibration.name} ({identity[:SHORT]})",
                columns=("quantity", "value", "95 % interval"),
                values=content_rows(calibration, cited=identity),
            )
            for identity, calibration in sorted(record.calibrations.items())
        ),
        *history_tables(record),
    )


def measure(value: float, unit: str) -> str:
    """A number with its unit."""
    return f"{value:.4g} {unit}".strip()


def _result(record: TargetRecord) -> tuple[Table, ...]:
    rows = () if record.estimates else tuple(_truth_rows(record.target.truth))
    truth = (Table(title="What is true of the phantom", columns=("quantity", "truth"), values=rows),) if rows else ()
    return (*truth, *(table for stored in newest_first(record) for table in result_tables(record, stored)))


def _truth_rows(truth: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    for name, value in truth.items():
        yield quantity_of(name).title, measure(value, quantity_of(name).unit)


def result_tables(record: TargetRecord, stored: Result) -> tuple[Table, ...]:
    """The numbers of an active estimate, or the lumps of the active map with flags and next places."""
    title, truth = heading(record, stored, "Current estimate"), record.target.truth
    if isinstance(stored.estimate, LumpMap):
        return _map_page(stored.estimate).tables
    if stored.kind == HARDNESS:
        true = [(f"truth of {name}", value) for name, value in _truth_rows(truth)]
        values = (*hardness_rows(stored.estimate), *true)
        return (Table(title=title, columns=("quantity", "value"), values=values),)
    return (estimate_table(stored.estimate, title=title, truth=truth),)


def _presses(record: TargetRecord) -> tuple[Table, ...]:
    if not record.presses:
        return ()
    noted = any(press.name or press.note for press in record.presses)
    headings = ("no.", "taken (UTC)", "role", "force", "mm per pixel", "flags", "frame, SHA-256")
    rows = tuple(
        _press_row(number, press) + ((": ".join(filter(None, (press.name, press.note))),) if noted else ())
        for number, press in enumerate(record.presses, 1)
    )
    return (Table(title="Presses", columns=(*headings, "name and note") if noted else headings, values=rows),)


def _press_row(number: int, press: StoredPress) -> tuple[str, ...]:
    return (
        str(number),
        time_text(press.taken),
        press.role,
        "not measured" if press.force_n is None else f"{press.force_n:.3g} N",
        "not known" if press.mm_per_pixel is None else "{:.4g} × {:.4g}".format(*press.mm_per_pixel),
        ", ".join(press.flags) or "none",
        press.frame[:SHORT],
    )


def history_tables(record: TargetRecord) -> tuple[Table, ...]:
    """All estimates and maps; no table where there is none."""
    if not record.active_results:
        return ()
    headings = ("made (UTC)", "estimate", "kind", "tsis", "mean and 90 % interval", "presses", "replaces")
    rows = tuple(_history_row(stored) for stored in record.results)
    return (Table(title="All estimates; the last of each kind is current", columns=headings, values=rows),)


def _history_row(stored: Result) -> tuple[str, ...]:
    return (
        time_text(stored.made),
        stored.id[:SHORT],
        stored.kind,
        str(stored.environment.get("tsis", "not known")),
        result_text(stored),
        str(len(stored.presses)),
        stored.supersedes[:SHORT] if stored.supersedes else "none",
    )


def result_text(stored: Result) -> str:
    """An estimate in one line: mean and 90 % interval of each parameter, or each lump, unless they are withheld."""
    estimate = stored.estimate
    if not estimate.trusted:
        return "not to be trusted"
    if isinstance(estimate, LumpMap):
        return lumps_text(estimate)
    return "; ".join(_value_text(estimate, name) for name in estimate.names)


TAG = re.compile(r"(?<!\S)#([\w-]+)")


def tags_of(note: str) -> tuple[str, ...]:
    """Words of a note that begin with a number sign.

    Examples
    --------
    >>> tags_of("second day #pilot, with #gel-2")
    ('pilot', 'gel-2')
    """
    return tuple(dict.fromkeys(TAG.findall(note)))


RESULT_COLUMNS = ("mean", "90 % interval, low", "90 % interval, high")


def result_rows(records: Iterable[TargetRecord]) -> list[tuple[object, ...]]:
    """A table of targets, headings first: an estimate in force a row, or a row without numbers.

    Numbers that are withheld stay empty; of a subject there is no note.
    """
    names = ("diameter_mm", "depth_mm", "young_kpa")
    head = ("target", "kind", "name", "tags", "note", "estimate", "made (UTC)", "flags")
    rows: list[tuple[object, ...]] = [(*head, *(f"{name}, {what}" for name in names for what in RESULT_COLUMNS))]
    for record in records:
        target = record.target
        note = "" if target.kind == "subject" else target.note
        about = (target.number, target.kind, target.name, " ".join(tags_of(note)), note)
        for stored in newest_first(record):
            numbers = [cell for name in names for cell in _numbers(stored.estimate, name)]
            made = (stored.kind, time_text(stored.made), " ".join(stored.estimate.flags))
            rows.append((*about, *made, *numbers))
        if not record.active_results:
            rows.append((*about, *("",) * (len(rows[0]) - len(about))))
    return rows


def _numbers(estimate: Estimate | LumpMap, name: str) -> tuple[object, ...]:
    if isinstance(estimate, LumpMap) or name not in estimate.names or not estimate.trusted:
        return "", "", ""
    low, high = estimate.interval(INTERVAL_LEVEL)[name]
    return "" if estimate.withheld_reason(name) else estimate.mean[name], low, high


def _value_text(estimate: Estimate, name: str) -> str:
    text, unit = quantity_of(name).title, quantity_of(name).unit
    low, high = estimate.interval(INTERVAL_LEVEL)[name]
    mean = estimate.withheld_reason(name) or f"{estimate.mean[name]:.3g} {unit}".strip()
    return f"{text} {mean} ({low:.3g} to {high:.3g})"


def target_page(record: TargetRecord) -> Page:
    """The page of a target, for `tsis.present.html.html_bytes` and `tsis.present.pdf.pdf_bytes`.

    Parameters
    ----------
    record
        All that the store holds of it; with no estimate, scale, force or calibration the page says so.

    Returns
    -------
    Page
        The estimates in force, the newest first, pictures of the strongest press, every press with its flags,
        calibrations, all estimates and where each number came from. That of a subject shows the pseudonym and no
        other name.
    """
    stale = stale_notes(record)  # which needs the presses as they are stored
    record = without_identity(record)
    target, gallery = record.target, target_gallery(record)
    name = f": {target.name}" if target.name else ""
    return Page(
        title=f"{'Subject, target' if target.kind == 'subject' else 'Target'} {target.number}{name}",
        subtitle=_subtitle(record),
        cards=target_cards(record),
        notes=(*stale, *target_notes(record), *gallery.notes),
        pictures=gallery.pictures,
        tables=target_tables(record),
        provenance=_provenance(record),
    )


def _subtitle(record: TargetRecord) -> str:
    presses = record.presses
    if not presses:
        return f"{record.target.kind}, entered {time_text(record.target.made)} UTC, nothing recorded"
    first, last = min(press.taken for press in presses), max(press.taken for press in presses)
    taken = time_text(first) if first == last else f"{time_text(first)} to {time_text(last)}"
    probes = ", ".join(sorted({press.probe for press in presses if press.probe})) or "not named"
    return f"{record.target.kind}, probe {probes}, recorded {taken} UTC"


def target_cards(record: TargetRecord) -> tuple[Card, ...]:
    """The numbers of the active estimates, the newest first; without an estimate the available presses."""
    result = newest_first(record)
    if not result:
        return (
            Card(title="Estimate", value="none yet", detail="the frames are kept and can be estimated", doubtful=True),
            Card(title="Recorded", value=counted(len(record.presses), "press"), detail=roles(record.presses)),
        )
    cards = []
    for stored in result:
        own = (
            _map_page(stored.estimate).cards
            if isinstance(stored.estimate, LumpMap)
            else estimate_cards(stored, record.target.truth)
        )
        cards += [replace(card, title=heading(record, stored, card.title)) for card in own]
    return tuple(cards)


def _provenance(record: TargetRecord) -> dict[str, Any]:
    """Provenance with whole hashes and identities."""
    target = record.target
    results = {heading(record, item, "estimate in force"): _estimate(item) for item in newest_first(record)}
    stored = {} if len(results) > 1 else next(iter(results.values()), {})
    return {
        "target": {"id": target.id, "version": target.version, "entered": time_text(target.made) + " UTC"},
        "report": f"tsis {__version__}",
        **(stored or results),
        **{f"press {number}": _press(press) for number, press in enumerate(record.presses, 1)},
        "calibrations": [
            {"name": calibration.name, "sha256": identity}
            for identity, calibration in sorted(record.calibrations.items())
        ],
    }


def _estimate(stored: Result) -> dict[str, Any]:
    return {
        "estimate in force": {
            "id": stored.id,
            "kind": stored.kind,
            "probe": stored.probe,
            "calibration": stored.calibration,
            "supersedes": stored.supersedes or "nothing",
            "presses": list(stored.presses),
        },
        "options": dict(stored.options),
        "environment": dict(stored.environment),
        "computed from": dict(stored.estimate.provenance),
    }


def _press(press: StoredPress) -> str:
    """A line for each press: there may be hundreds."""
    messages = [
        f"frame {press.frame}",
        f"id {press.id}, version {press.version}",
        f"{press.columns} × {press.rows} pixels, full scale {press.full_scale:g}",
        "axis at ({:g}, {:g}) px".format(*press.axis_px),
        f"probe {press.probe or 'not named'}",
        f"calibration {press.calibration or 'none'}",
        *(f"{name} {value}" for name, value in press.settings.items()),
    ]
    return "; ".join(messages)
