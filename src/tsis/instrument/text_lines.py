"""Lines of a text file, one at a time: a list of them could take thirty times the file."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from tsis.model.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import Iterator

LONGEST_LINE = 65_536
_FEW = 10_000  # lines that may be empty or comments


def text_lines(content: bytes, *, most: int) -> Iterator[tuple[int, str]]:
    r"""Number, from 1, and text of each line of UTF-8, without its end.

    Parameters
    ----------
    content
        The whole file; lines end as on any system.
    most
        Lines that may say something; ten thousand more may be empty.

    Raises
    ------
    FileInputError
        When it is no such text, has more lines or one that is longer than 65536 bytes; the sentence does not name the
        file.

    Examples
    --------
    >>> list(text_lines(b"\xef\xbb\xbfx,y\r\n1,2", most=10))
    [(1, 'x,y'), (2, '1,2')]
    """
    ends = content.count(b"\n")
    if not ends:
        content = content.replace(b"\r", b"\n")
        ends = content.count(b"\n")
    if ends > most + _FEW:
        raise FileInputError(f"it must have at most {most} lines; got {ends}")
    stream, number = io.BytesIO(content), 0
    while line := stream.readline(LONGEST_LINE + 1):
        number += 1
        if len(line) > LONGEST_LINE:
            raise FileInputError(f"line {number} must be at most {LONGEST_LINE} bytes long; it is longer")
        try:
            yield number, line.decode("utf-8-sig" if number == 1 else "utf-8").rstrip("\r\n")
        except UnicodeDecodeError as error:
            raise FileInputError(f"line {number} must be text in UTF-8; it holds other bytes") from error
