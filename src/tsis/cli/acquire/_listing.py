"""What ``tsis acquire --list`` and ``--modes`` show."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import tsis
from tsis.cli._output import print_json
from tsis.cli._progress import waiting
from tsis.present.page import Column, Table
from tsis.present.terminal import people, print_notice, rich_table

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.instrument.camera import Camera, Setting


VIRTUAL_NOTE = "no hardware: the virtual probe"


def list_cameras(*, as_json: bool) -> None:
    """Print every camera that responds, and what the other drivers lack."""
    with waiting("searching for cameras"):
        findings = tsis.instrument.discovery.find_cameras()
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "acquire", "list", found=[asdict(item) for item in findings.cameras], missing=dict(findings.missing)
            )
        )
        return
    console = people()
    rows = tuple((item.spec, item.maker, item.model, item.note) for item in findings.cameras)
    columns = ("--camera", "maker", "model", "note")
    console.print(
        rich_table(Table(title="Cameras", columns=columns, values=(("virtual", "", "", VIRTUAL_NOTE), *rows)))
    )
    if findings.missing:
        console.print("Not looked for:")
    for message in findings.missing.values():
        console.print(f"- {message}", markup=False, soft_wrap=True)
    print_notice(console)


def show_camera(connect_camera: Callable[[], Camera], *, as_json: bool) -> None:
    """Print a camera's modes and settings."""
    camera = connect_camera()
    camera.open()
    try:
        name, modes, settings = camera.name, camera.modes(), camera.settings()
    finally:
        camera.stop()
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "acquire",
                "describe",
                camera=name,
                modes=[{"mode": mode.label, **asdict(mode)} for mode in modes],
                settings=[
                    {"name": setting.name, "value": setting.value, "unit": setting.unit, **_finite_range(setting)}
                    for setting in settings
                ],
            )
        )
        return
    console = people()
    console.print("Modes, the default first: " + ", ".join(mode.label for mode in modes), markup=False)
    table = Table(
        title=name,
        columns=("setting", *(Column(label=label) for label in ("now", "lowest", "highest")), "unit"),
        values=tuple(
            (setting.name, setting.value, _bound(setting.low), _bound(setting.high), setting.unit)
            for setting in settings
        ),
    )
    console.print(rich_table(table) if settings else "It has no settings.")
    print_notice(console)


def _finite_range(setting: Setting) -> dict[str, float | None]:
    import numpy as np

    return {
        "low": setting.low if np.isfinite(setting.low) else None,
        "high": setting.high if np.isfinite(setting.high) else None,
    }


def _bound(value: float) -> str:
    import numpy as np

    return f"{value:g}" if np.isfinite(value) else "not told"
