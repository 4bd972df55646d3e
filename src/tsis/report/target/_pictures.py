"""Pictures of a target: the strongest press and its change, profiles, all frames, and the posterior."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from tsis.catalog import load_probe
from tsis.errors import InputError, TsisError, UnknownNameError
from tsis.imaging import subtract_background
from tsis.inclusion import InclusionPrior, ring_edges
from tsis.report._frames import change_picture, force_of, frame_picture, profile_picture, sheet_picture, surface_picture
from tsis.report._hardness import modulus_picture
from tsis.report._inclusion import marginals_picture, trade_off_picture
from tsis.report.target._text import newest_first

if TYPE_CHECKING:
    from tsis.model import TactileImage
    from tsis.records import StoredEstimate, TargetRecord
    from tsis.report._page import Picture


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
    """All pictures of the frames and the active estimates."""
    frames, unread = _frames(record)
    gallery = unread + _posteriors(record) + _strongest(frames) + _profiles(record, frames)
    if len(frames) > 1:
        gallery += Gallery(pictures=(sheet_picture([(frame.role, frame.image) for frame in frames]),))
    return gallery


def _frames(record: TargetRecord) -> tuple[list[FrameWithRole], Gallery]:
    """Frames in the order of their presses, of many only those of the estimates, and messages on unreadable ones."""
    used = {press for stored in record.active_estimates for press in stored.presses}
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


def _posterior(record: TargetRecord, stored: StoredEstimate) -> Gallery:
    if not stored.estimate.trusted:
        return Gallery()
    estimate, truth = stored.estimate, record.target.truth
    if stored.kind == "hardness":
        return Gallery(pictures=(modulus_picture(estimate, truth.get("young_kpa")),))
    joint = (trade_off_picture(estimate, truth),) if len(estimate.names) > 1 else ()
    prior = _prior(stored)
    if prior is None:
        return Gallery(pictures=joint, notes=("The stored prior has no form in which the posteriors can be drawn.",))
    return Gallery(pictures=(marginals_picture(estimate, prior, truth), *joint))


def _prior(stored: StoredEstimate) -> InclusionPrior | None:
    """The prior of the estimate, or None where the record has another kind of prior."""
    reported = stored.estimate.provenance.get("prior") or stored.options.get("prior") or {}
    if not isinstance(reported, Mapping) or not all(hasattr(InclusionPrior, name) for name in stored.estimate.names):
        return None
    fields: dict[str, Any] = {
        str(name): tuple(value) if isinstance(value, list) else value for name, value in reported.items()
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
            message = f"{target.name} minus {near.image.name}, {what}; outline and centroid in white."
            pictures.append(change_picture(signal, title=title, caption=message))
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
