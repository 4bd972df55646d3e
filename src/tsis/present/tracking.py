"""Report of a sequence of frames of a press: the mobility of the light, and whether the press has settled."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.present.figures import light_over_time, light_path
from tsis.present.page import Card, Page, Picture, Table, on_axes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from tsis.inclusion.press_track import PressTrack


NO_TIMES = "Settling is not judged: it needs the times of the frames."


def track_rows(track: PressTrack) -> tuple[tuple[str, str], ...]:
    """Names and values, for people."""
    movement, settling = track.mobility, track.settling
    rows = [
        ("frames", f"{len(movement.position_mm)}"),
        ("excursion", "none seen" if movement.excursion_mm is None else f"{movement.excursion_mm:.3g} mm"),
        ("path", "none seen" if movement.path_mm is None else f"{movement.path_mm:.3g} mm"),
        ("noise of one position", f"{movement.noise_mm:.2g} mm"),
        ("path by noise alone", f"{movement.noise_path_mm:.2g} mm"),
    ]
    if settling is not None:
        rows += [
            ("settling", settling.verdict),
            ("change still to come", f"{100 * settling.remaining.value:.2g} %, at most {100 * settling.bound:.2g} %"),
            ("wait", "unknown" if settling.wait_s is None else f"{settling.wait_s:.3g} s"),
        ]
    return tuple(rows)


def track_notes(track: PressTrack) -> tuple[str, ...]:
    """Notes and assumptions."""
    assumed = (f"Assumed: {assumption}" for assumption in track.mobility.assumptions)
    return (*track.mobility.notes, *assumed, *(() if track.settling is not None else (NO_TIMES,)))


def track_document(track: PressTrack) -> dict[str, Any]:
    """The track as a JSON document, with null positions for frames without contact."""
    movement = {field.name: getattr(track.mobility, field.name) for field in fields(track.mobility)}
    movement["position_mm"] = [
        None if np.isnan(position[0]) else position.tolist() for position in track.mobility.position_mm
    ]
    movement["step_mm"] = [None if np.isnan(step) else float(step) for step in track.mobility.step_mm]
    settling = None
    if track.settling is not None:
        remaining = track.settling.remaining
        settling = {
            "verdict": track.settling.verdict,
            "remaining": {"value": remaining.value, "sd": remaining.sd},
            "bound": track.settling.bound,
            "wait_s": track.settling.wait_s,
        }
    return {
        "mobility": movement,
        "settling": settling,
        "time_s": None if track.time_s is None else track.time_s.tolist(),
        "total_grey": track.total_grey.tolist(),
    }


def track_page(track: PressTrack, *, subtitle: str, provenance: Mapping[str, Any]) -> Page:
    """The report: the path of the light, its sum over time, and the numbers."""
    movement, settling = track.mobility, track.settling
    still = movement.excursion_mm is None or "no_movement" in movement.flags
    cards = [
        Card(
            title="Excursion",
            value="none seen" if movement.excursion_mm is None else f"{movement.excursion_mm:.3g} mm",
            detail=f"noise of one position {movement.noise_mm:.2g} mm",
            doubtful=still,
        )
    ]
    if settling is not None:
        detail = f"at most {100 * settling.bound:.2g} % still to come"
        cards.append(Card(title="Settling", value=settling.verdict, detail=detail, doubtful=not settling.settled))
    return Page(
        title="Movement and settling of a press",
        subtitle=subtitle,
        cards=tuple(cards),
        notes=track_notes(track),
        pictures=_pictures(track),
        tables=(Table(title="What the sequence says", columns=("quantity", "value"), values=track_rows(track)),),
        provenance=provenance,
    )


def _pictures(track: PressTrack) -> tuple[Picture, ...]:
    times = np.arange(len(track.total_grey), dtype=float) if track.time_s is None else track.time_s

    def series(figure: Figure) -> None:
        ax = light_over_time(times, track.total_grey, figure.subplots())
        if track.time_s is None:
            ax.set_xlabel("frame")

    return (
        Picture(
            title="Path of the light",
            draw=on_axes(light_path, track.mobility),
            size=(5.5, 4.2),
            alt="Centroid of the light in each frame, joined in the order of time",
            caption=f"Centroid of the light from the probe's axis, against the {track.mobility.against}.",
        ),
        Picture(
            title="Sum of the light",
            draw=series,
            size=(5.5, 3.6),
            alt="Sum of grey levels that the press changed, over time",
            caption="Sum of grey levels that the press changed.",
        ),
    )
