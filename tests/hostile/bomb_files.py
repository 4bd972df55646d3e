"""Small files that ask for much: more memory or time than any honest file of their size would take."""

from __future__ import annotations

import base64
import io
import json
import struct
import zipfile
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.hostile import png_changed as png
from tests.hostile.record_loaders import known_calibration, sealed

from tsis.calibration.file import calibration_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

MB = 2**20
SIDE = 8000


@dataclass(frozen=True, slots=True, kw_only=True)
class Bomb:
    """A file that is larger inside than outside.

    Parameters
    ----------
    name
        What it does.
    loader
        Name of the loader that meets it.
    make
        Its bytes.
    harmless
        Whether it may be read, since the loader never unpacks what makes it a bomb.
    longest
        Size in bytes that it is drawn out to with a hole, which costs no disk; 0 for none.
    large
        Whether it takes seconds to make.
    """

    name: str
    loader: str
    make: Callable[[], bytes]
    harmless: bool = False
    longest: int = 0
    large: bool = False


def bombs() -> tuple[Bomb, ...]:
    """All of them."""
    return (*_png_bombs(), *_other_picture_bombs(), *_text_bombs(), *_archive_bombs(), *_holes())


def _zeros(size: int) -> bytes:
    """So many zeros, packed by deflate, in little memory."""
    packer = zlib.compressobj(9)
    parts = [packer.compress(bytes(MB)) for _ in range(size // MB)]
    return b"".join([*parts, packer.compress(bytes(size % MB)), packer.flush()])


def _png(columns: int, rows: int, data: bytes, *, depth: int = 8, colour: int = 0, more: bytes = b"") -> bytes:
    header = png.chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, depth, colour, 0, 0, 0))
    return png.SIGNATURE + header + more + png.chunk(b"IDAT", data) + png.chunk(b"IEND", b"")


def _png_bombs() -> tuple[Bomb, ...]:
    def noted() -> bytes:
        packed = _zeros(200 * MB)
        notes = png.chunk(b"zTXt", b"a\0\0" + packed) + png.chunk(b"iCCP", b"a\0\0" + packed)
        notes += png.chunk(b"iTXt", b"a\0\1\0\0\0" + packed)
        return _png(9, 9, zlib.compress(bytes(90)), more=notes * 10)

    noise = np.random.default_rng(1).bytes(4 * MB)
    loader = "picture, PNG"
    return (
        Bomb(
            name="64 million pixels in 64 KB, the last missing",
            loader=loader,
            make=lambda: _png(SIDE, SIDE, _zeros(SIDE * SIDE + SIDE - 1)),
        ),
        Bomb(
            name="64 million pixels of 8 bytes in 0.5 MB",
            large=True,
            loader=loader,
            make=lambda: _png(SIDE, SIDE, _zeros(8 * SIDE * SIDE + SIDE), depth=16, colour=6),
        ),
        Bomb(
            name="64 million pixels declared, most missing, drawn out with noise",
            large=True,
            loader=loader,
            make=lambda: _png(SIDE, SIDE, _zeros(300 * MB) + noise, depth=16, colour=6),
        ),
        Bomb(
            name="16 million pixels of 8 bytes, the last row missing",
            loader=loader,
            make=lambda: _png(4000, 4000, _zeros(8 * 3999 * 4000), depth=16, colour=6),
        ),
        Bomb(name="30 notes of 200 MB each", large=True, loader=loader, make=noted, harmless=True),
        Bomb(
            name="a million empty chunks",
            loader=loader,
            make=lambda: _png(9, 9, zlib.compress(bytes(90)), more=png.chunk(b"tEXt", b"") * 1_000_000),
        ),
        Bomb(
            name="a million pictures declared",
            loader=loader,
            make=lambda: _png(9, 9, zlib.compress(bytes(90)), more=png.chunk(b"acTL", struct.pack(">II", 10**6, 0))),
        ),
    )


def _jpeg(segments: bytes, scans: int, side: int) -> bytes:
    """A progressive JPEG whose scans hold nothing."""
    frame = b"\xff\xc2" + struct.pack(">HBHHB", 11, 8, side, side, 1) + b"\x01\x11\x00"
    table = b"\xff\xdb" + struct.pack(">HB", 67, 0) + bytes([1] * 64)
    code = b"\xff\xc4" + struct.pack(">HB", 20, 0) + bytes([1] + [0] * 15) + b"\x00"
    scan = b"\xff\xda" + struct.pack(">HB", 8, 1) + b"\x01\x00" + b"\x00\x00\x00" + bytes(8)
    return b"\xff\xd8" + segments + table + frame + code + scan * scans + b"\xff\xd9"


def _crossed_exif(size: int) -> bytes:
    """Notes whose thousands of entries all name the same bytes."""
    entries, data = size // 24, size // 2
    directory = b"".join(struct.pack("<HHII", 50000 + at % 10_000, 7, data, 8) for at in range(entries))
    body = b"II*\0\x08\0\0\0" + struct.pack("<H", entries) + directory
    return body.ljust(size, b"\0")


def _tiff(entries: list[tuple[int, int, int, int]], size: int, following: int = 0) -> bytes:
    body = b"".join(struct.pack("<HHII", *entry) for entry in sorted(entries))
    return (b"II*\0\x08\0\0\0" + struct.pack("<H", len(entries)) + body + struct.pack("<I", following)).ljust(
        size, b"\0"
    )


def _other_picture_bombs() -> tuple[Bomb, ...]:
    exif = b"Exif\0\0" + _crossed_exif(60_000)
    notes = (b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif) * 150

    def directories() -> bytes:
        one = struct.pack("<HHHII", 1, 256, 3, 1, 9)
        return b"II*\0\x08\0\0\0" + b"".join(one + struct.pack("<I", 8 + 18 * (at + 1)) for at in range(100_000))

    def packed_tiff() -> bytes:
        data = _zeros(SIDE * SIDE)
        tags = {256: SIDE, 257: SIDE, 258: 8, 259: 8, 262: 1, 273: 200, 277: 1, 278: SIDE, 279: len(data)}
        return _tiff([(tag, 4, 1, value) for tag, value in tags.items()], 200) + data

    crossed = [(1000 + at, 7, 2**20, 8) for at in range(4000)]
    bitmap = struct.pack("<2sIHHIIiiHHIIiiII", b"BM", 54, 0, 0, 54, 40, SIDE, SIDE, 1, 8, 1, 0, 0, 0, 0, 0)
    return (
        Bomb(
            name="9 MB of notes that name each other",
            loader="picture, JPEG",
            make=lambda: _jpeg(notes, 1, 16),
            harmless=True,
        ),
        Bomb(name="3000 empty scans of 64 million pixels", loader="picture, JPEG", make=lambda: _jpeg(b"", 3000, SIDE)),
        Bomb(name="64 million pixels in 200 bytes", loader="picture, JPEG", make=lambda: _jpeg(b"", 3, SIDE)),
        Bomb(
            name="4000 entries that name the same megabyte", loader="picture, TIFF", make=lambda: _tiff(crossed, 2 * MB)
        ),
        Bomb(name="100 000 directories in a chain", loader="picture, TIFF", make=directories),
        Bomb(name="64 million pixels in 64 KB", loader="picture, TIFF", make=packed_tiff),
        Bomb(name="64 million pixels in 60 bytes", loader="picture, BMP", make=lambda: bitmap),
    )


def _calibration_with(change: Callable[[dict[str, Any]], None]) -> bytes:
    document = json.loads(calibration_bytes(known_calibration()))
    change(document["calibration"])
    return json.dumps(sealed(document)).encode()


def _map_bomb(*names: str) -> bytes:
    bomb = {"shape": [4000, 4000], "kind": "double", "sha256": "0" * 64}
    bomb["zlib"] = base64.b64encode(_zeros(4000 * 4000 * 8)).decode()
    maps: Mapping[str, Any] = dict.fromkeys(names, bomb)
    return _calibration_with(lambda known: known["reference"].update(maps))


def _text_bombs() -> tuple[Bomb, ...]:
    start = b'{"format": "tsis-calibration", "version": 1, "calibration": '
    return (
        Bomb(
            name="three maps of 128 MB in 0.5 MB",
            loader="calibration",
            make=lambda: _map_bomb("dark_grey", "untouched_grey", "relative_light"),
        ),
        Bomb(name="a map of 128 MB in 0.2 MB", loader="calibration", make=lambda: _map_bomb("dark_grey")),
        Bomb(
            name="40 million empty lists",
            large=True,
            loader="calibration",
            make=lambda: start + b"[" + b"[]," * 40_000_000 + b"[]]}",
        ),
        Bomb(name="a million brackets deep", loader="calibration", make=lambda: start + b"[" * 1_000_000),
        Bomb(name="900 brackets deep", loader="calibration", make=lambda: start + b"[" * 900 + b"]" * 900 + b"}"),
        Bomb(name="a number of 8 million digits", loader="calibration", make=lambda: start + b"9" * 8_000_000 + b"}"),
        Bomb(
            name="100 MB of text, one letter of four bytes",
            large=True,
            loader="calibration",
            make=lambda: start + b'"' + b"a" * (100 * MB) + "\U0001f600".encode() + b'"}',
        ),
        Bomb(name="200 000 empty lists", loader="values to seal", make=lambda: b'{"a": [' + b"[]," * 200_000 + b"[]]}"),
        Bomb(name="8 million empty lines", loader="session, index", make=lambda: b"\n" * (8 * MB - 1)),
        Bomb(name="a key of 100 000 parts", loader="sweep, plan", make=lambda: b"a" + b".a" * 100_000 + b" = 1"),
        Bomb(name="brackets", loader="sweep, plan", make=lambda: b"a = " + b"[" * 200_000),
        Bomb(
            name="20 million empty lists",
            large=True,
            loader="sweep, manifest",
            make=lambda: b'{"a": [' + b"[]," * 20_000_000 + b"[]]}",
        ),
        Bomb(name="120 million empty lines", large=True, loader="points, CSV", make=lambda: b"\n" * (120 * MB)),
        Bomb(name="25 million points", large=True, loader="points, CSV", make=lambda: b"1,2\n" * 25_000_000),
        Bomb(name="a line of 100 MB", large=True, loader="points, CSV", make=lambda: b"1," * (50 * MB)),
        Bomb(
            name="60 million empty lines",
            large=True,
            loader="force readings",
            make=lambda: b"time_s,force_n\n" + b"\n" * (60 * MB),
        ),
    )


def _archive_bombs() -> tuple[Bomb, ...]:
    def npz() -> bytes:
        stream, head = io.BytesIO(), io.BytesIO()
        np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (50 * MB, 2)})
        with (
            zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive,
            archive.open("points.npy", "w") as file,
        ):
            file.write(head.getvalue())
            for _ in range(800):
                file.write(bytes(MB))
        return stream.getvalue()

    return (
        Bomb(name="800 MB in 0.8 MB", large=True, loader="array archive", make=npz),
        Bomb(name="240 MB in 0.1 MB", large=True, loader="sweep, shard", make=_parquet),
    )


def _parquet() -> bytes:
    """A file of thirty million rows."""
    import pyarrow as pa
    from pyarrow import parquet

    sink = pa.BufferOutputStream()
    table = pa.table({"force_n": pa.array(np.zeros(30_000_000))})
    with parquet.ParquetWriter(sink, table.schema, compression="zstd", use_dictionary=False) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue().to_pybytes())


def _holes() -> tuple[Bomb, ...]:
    """Files of gigabytes that take no disk."""
    starts = {
        "picture, PNG": png.SIGNATURE,
        "picture, JPEG": b"\xff\xd8\xff\xe0",
        "picture, TIFF": b"II*\0\x08\0\0\0",
        "picture, BMP": b"BM",
        "video": b"RIFF",
        "calibration": b"{",
        "session, terms": b"{",
        "session, index": b"file,time_s",
        "sweep, plan": b"probe",
        "sweep, manifest": b"{",
        "sweep, shard": b"PAR1",
        "points, CSV": b"1,2\n",
        "points, NPY": b"\x93NUMPY\x01\0",
        "array archive": b"PK\x03\x04",
        "force readings": b"time_s,force_n\n",
    }
    return tuple(
        Bomb(name="8 GB of nothing", loader=loader, make=lambda start=start: start, longest=8 * 2**30)  # type: ignore[misc]
        for loader, start in starts.items()
    )
