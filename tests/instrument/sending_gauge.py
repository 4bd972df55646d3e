"""A gauge at a terminal of this machine, in this process."""

from __future__ import annotations

import os
import threading
import tty
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def sending(line: bytes) -> Iterator[str]:
    """A terminal at whose other end a gauge sends this line again and again."""
    near, far = os.openpty()
    tty.setraw(far)
    over = threading.Event()

    def send() -> None:
        while not over.wait(0.005):
            os.write(near, line)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield os.ttyname(far)
    finally:
        over.set()
        thread.join()
        os.close(far)
        os.close(near)
