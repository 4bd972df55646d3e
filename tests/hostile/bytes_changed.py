"""Damage to bytes that knows nothing of their format: what disks, cables and fuzzers do."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

EXTREMES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 2**63 - 1, 2**64 - 1)
MAGICS = (
    b"\x89PNG\r\n\x1a\n",
    b"\xff\xd8\xff\xe0",
    b"BM",
    b"II*\0",
    b"MM\0*",
    b"II+\0\x08\0\0\0",
    b"\x93NUMPY",
    b"ply\n",
    b"PK\x03\x04",
    b"PAR1",
    b"GIF89a",
    b"RIFF",
    b"%PDF-1.7",
    b"{",
    b"\xef\xbb\xbf",
    b"\xff\xfe",
    b"\0\0\0\0",
)
TOKENS = (
    b"NaN",
    b"nan",
    b"inf",
    b"-Infinity",
    b"Infinity",
    b"1e999",
    b"-1e999",
    b"1e308",
    b"5e-324",
    b"-0.0",
    b"0",
    b"-1",
    b"99999999999999999999999999",
    b"9" * 5000,
    b"2147483648",
    b"1_000",
    b"0x10",
    b"true",
    b"null",
    b'""',
    b"[]",
    b"{}",
    b'"',
    b"'",
    b",",
    b"\n",
    b"\r",
    b"\0",
    b"\x1b[2J",
    b"\xff\xfe",
    b"\xc3(",
    b"\xed\xa0\x80",
    b"\\ud800",
    b'"\\ud800"',
    b"\xe2\x80\xa8",
    b"\xd9\xa1\xd9\xa2",
    b"[" * 3000,
    b'{"a":' * 3000,
    b"(" * 300,
    b"a" * 200_000,
    b"../../etc/passwd",
    b"/dev/zero",
    b"1979-05-27T07:32:00Z",
)
_TOKEN = re.compile(rb"-?[0-9][0-9.eE+-]*|[A-Za-z_][A-Za-z0-9_-]*")


def flipped(content: bytearray, rng: np.random.Generator) -> bytearray:
    """One to eight bits the other way round."""
    for _ in range(int(rng.integers(1, 9))):
        content[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))
    return content


def overwritten(content: bytearray, rng: np.random.Generator) -> bytearray:
    """A few bytes at random, or a run of equal ones."""
    start, length = int(rng.integers(len(content))), int(rng.integers(1, 17))
    new = rng.bytes(length) if rng.random() < 0.5 else bytes([int(rng.integers(256))]) * length
    content[start : start + length] = new[: len(content) - start]
    return content


def truncated(content: bytearray, rng: np.random.Generator) -> bytearray:
    """The beginning, of any length from 0."""
    del content[int(rng.integers(len(content))) :]
    return content


def extended(content: bytearray, rng: np.random.Generator) -> bytearray:
    """Something behind the end: noise, zeros, or the file again."""
    kind, length = int(rng.integers(3)), int(rng.integers(1, 300))
    return content + (rng.bytes(length), bytes(length), bytes(content))[kind]


def _block(content: bytearray, rng: np.random.Generator) -> tuple[int, int]:
    start = int(rng.integers(len(content)))
    return start, start + int(rng.integers(1, max(2, len(content) // 4)))


def block_deleted(content: bytearray, rng: np.random.Generator) -> bytearray:
    """A part is missing in the middle."""
    start, end = _block(content, rng)
    del content[start:end]
    return content


def block_doubled(content: bytearray, rng: np.random.Generator) -> bytearray:
    """A part stands there twice, or many times."""
    start, end = _block(content, rng)
    content[start:start] = content[start:end] * int(rng.choice([1, 1, 1, 30]))
    return content


def block_moved(content: bytearray, rng: np.random.Generator) -> bytearray:
    """A part stands elsewhere."""
    start, end = _block(content, rng)
    taken = content[start:end]
    del content[start:end]
    place = int(rng.integers(len(content) + 1))
    content[place:place] = taken
    return content


def number_set(content: bytearray, rng: np.random.Generator) -> bytearray:
    """Some bytes hold the largest or smallest number of their width."""
    width = int(rng.choice([1, 2, 4, 8]))
    near = int(rng.integers(min(len(content), 64))) if rng.random() < 0.5 else int(rng.integers(len(content)))
    value = EXTREMES[int(rng.integers(len(EXTREMES)))] & (2 ** (8 * width) - 1)
    content[near : near + width] = value.to_bytes(width, "little" if rng.random() < 0.5 else "big")
    return content


def magic_swapped(content: bytearray, rng: np.random.Generator) -> bytearray:
    """It begins as another kind of file does."""
    magic = MAGICS[int(rng.integers(len(MAGICS)))]
    content[: len(magic)] = magic
    return content


def token_swapped(content: bytearray, rng: np.random.Generator) -> bytearray:
    """A number or word of a text became something that no such place should hold."""
    start = int(rng.integers(min(len(content), 4000)))
    found = _TOKEN.search(content, start) or _TOKEN.search(content)
    token = TOKENS[int(rng.integers(len(TOKENS)))]
    place = found.span() if found is not None and rng.random() < 0.8 else (start, start)
    content[place[0] : place[1]] = token
    return content


def line_changed(content: bytearray, rng: np.random.Generator) -> bytearray:
    """A line is missing, doubled, swapped with another or ends otherwise."""
    lines = content.split(b"\n")
    one, two = (int(rng.integers(min(len(lines), 2000))) for _ in range(2))
    kind = int(rng.integers(4))
    if kind == 0:
        del lines[one]
    elif kind == 1:
        lines.insert(one, lines[two])
    elif kind == 2:
        lines[one], lines[two] = lines[two], lines[one]
    else:
        lines[one] = lines[one] + bytearray((b"\r", b"\0", b",", b" #", b"\xff")[int(rng.integers(5))])
    return bytearray(b"\n").join(lines)


ANY: tuple[Callable[[bytearray, np.random.Generator], bytearray], ...] = (
    flipped,
    overwritten,
    truncated,
    extended,
    block_deleted,
    block_doubled,
    block_moved,
    number_set,
    magic_swapped,
)
TEXT = (*ANY, token_swapped, token_swapped, token_swapped, line_changed)


def spliced(content: bytes, other: bytes, rng: np.random.Generator) -> bytearray:
    """The beginning of one file and the end of another."""
    return bytearray(content[: int(rng.integers(len(content) + 1))] + other[int(rng.integers(len(other) + 1)) :])


def damaged(content: bytes, other: bytes, rng: np.random.Generator, *, text: bool = False) -> bytes:
    """The content after one to three kinds of damage.

    Parameters
    ----------
    content, other
        The file, and another of its kind that it may be mixed with.
    rng
        Decides everything.
    text
        Whether numbers, words and lines are changed, too.
    """
    changed = spliced(content, other, rng) if rng.random() < 0.05 else bytearray(content)
    kinds = TEXT if text else ANY
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        if changed:
            changed = kinds[int(rng.integers(len(kinds)))](changed, rng)
    return bytes(changed)
