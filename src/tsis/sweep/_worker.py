"""A worker process: reads batches from its standard input and writes outcomes to its standard output.

It ends with its input, so that no worker outlives the sweep by more than one batch.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from typing import TYPE_CHECKING

from tsis.sweep._work import finish_batch

if TYPE_CHECKING:
    from typing import BinaryIO

    from tsis.sweep._work import SweepJob


def serve(requests: BinaryIO, responses: BinaryIO) -> None:
    """Answer every batch until the input ends."""
    job: SweepJob = pickle.load(requests)
    while True:
        try:
            batch = pickle.load(requests)
        except EOFError:
            return
        pickle.dump(finish_batch(job, batch), responses)
        responses.flush()


def main() -> None:
    """Serve on the standard streams."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the sweep decides when its workers stop
    # Printed text of a library must not reach the pipe of the outcomes.
    responses = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    try:
        serve(sys.stdin.buffer, responses)
    except (BrokenPipeError, EOFError, pickle.UnpicklingError):
        os._exit(1)  # the sweep has ended; flushing the pipe would only fail


if __name__ == "__main__":
    main()
