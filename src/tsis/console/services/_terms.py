"""The settings that a console was started with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tsis.console.services._subject import VIRTUAL, CameraChoice
from tsis.model import require_one_of
from tsis.records import KINDS


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentSettings:
    """Folders and initial settings of an instrument.

    Parameters
    ----------
    workspace
        Folder of snapshots, sequences and calibration sessions; made when it does not exist.
    store
        Folder of the store of records; that of this user and kind when None.
    kind
        Of that store: ``"phantom"`` or ``"subject"``.
    database
        URL of a PostgreSQL database for its rows; SQLite in the folder when None.
    camera
        ``"virtual"``, or a live camera as of `CameraChoice`.
    probe, phantom, seed
        Of the virtual probe: names in the catalog, also of a sphere in place of a phantom, and the seed of its errors.
    calibration
        Calibration file that is active at the start; the virtual probe's own when None.

    Raises
    ------
    InputError
        When a name is unknown or a value outside its range.
    """

    workspace: Path = Path("tsis-console")
    store: Path | None = None
    kind: str = KINDS[0]
    database: str | None = None
    camera: str = VIRTUAL
    probe: str = "tsis-domed"
    phantom: str = "hardness-100"
    seed: int = 4
    calibration: Path | None = None

    def __post_init__(self) -> None:
        require_one_of("kind of store", self.kind, KINDS)
        self.choice  # noqa: B018 - which refuses what cannot be chosen

    @property
    def choice(self) -> CameraChoice:
        """The camera to begin with."""
        return CameraChoice(spec=self.camera, probe=self.probe, phantom=self.phantom, seed=self.seed)
