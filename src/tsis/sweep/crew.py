"""What a sweep needs of its workers, be they processes of this machine or of a cluster."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from types import TracebackType
    from typing import Self

    from tsis.sweep.samples import SweepBatch
    from tsis.sweep.work import Answer


class WorkerPool(Protocol):
    """Workers that finish batches in any order."""

    @property
    def window(self) -> int:
        """How many batches it should hold at a time: enough that no worker waits, never all."""
        ...

    def submit(self, batch: SweepBatch) -> None:
        """Hand over a batch."""
        ...

    def collect(self) -> Answer:
        """Wait for the next answer."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
