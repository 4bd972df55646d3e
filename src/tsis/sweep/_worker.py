"""A worker of the own machine: reads batches from its standard input and answers on its standard output.

It ends when its input does, so that no worker outlives the sweep that started it by more than one batch.
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


def serve(questions: BinaryIO, responses: BinaryIO) -> None:
    """Answer every batch until there are no more."""
    job: SweepJob = pickle.load(questions)
    while True:
        try:
            batch = pickle.load(questions)
        except EOFError:
            return
        pickle.dump(finish_batch(job, batch), responses)
        responses.flush()


def main() -> None:
    """Serve on the standard streams."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the sweep decides when its workers stop
    # What a library prints must not reach the pipe that carries answers.
    responses = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    try:
        serve(sys.stdin.buffer, responses)
    except (BrokenPipeError, EOFError, pickle.UnpicklingError):
        os._exit(1)  # the sweep has gone; flushing the pipe would only complain


if __name__ == "__main__":
    main()
