"""What an address names."""

from __future__ import annotations

from contextlib import contextmanager
from functools import wraps
from typing import TYPE_CHECKING, ParamSpec

import numpy as np
from fastapi import APIRouter, Query, Request, Response
from starlette.responses import FileResponse, PlainTextResponse

from tsis.console._statuses import AbsentError, status_of
from tsis.console.files._exporting import MEDIA_TYPES, ExportFile, write_export
from tsis.console.studies import FORMS, report_bytes
from tsis.errors import InputError, TsisError
from tsis.files import LARGEST_TARGET, encode_picture
from tsis.imaging import COLOUR_MAPS, block_means, colour_map
from tsis.model import TactileImage, require_integer, require_one_of
from tsis.report import ENDINGS, PAGE_FORMS

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator
    from typing import Any

    from numpy.typing import NDArray
    from starlette.types import Receive, Scope, Send

    from tsis.console.files._exporting import Reports
    from tsis.console.studies import StudyRepository
    from tsis.records import StoredPress, Target
    from tsis.records.store import Store


MOST_DIGITS = 20  # that are turned into a number at all


def target_of(store: Store, text: str) -> Target:
    """The target whose number stands in an address; `AbsentError` when there is none."""
    if not (text.isascii() and text.isdigit() and len(text) <= MOST_DIGITS):
        raise AbsentError(f"target must be a number from 1 to {LARGEST_TARGET}; got {text!r:.40}")
    with _in_the_address():
        return store.target(int(text))


def press_of(store: Store, target: str, press: str) -> StoredPress:
    """The press whose identity stands in an address; `AbsentError` when there is none."""
    result = target_of(store, target)
    with _in_the_address():
        return store.press(result, press)


def form_of(name: str, text: str, forms: Collection[str]) -> str:
    """The form that stands in an address; `AbsentError` when there is none of that name."""
    with _in_the_address():
        return require_one_of(name, text, forms)


@contextmanager
def _in_the_address() -> Iterator[None]:
    """What an address names wrongly is not there."""
    try:
        yield
    except InputError as error:
        raise AbsentError(str(error)) from error


SMALLEST_PX, LARGEST_PX = 16, 1024  # of the longer side
GREY = "grey"
MAPS = (GREY, *sorted(COLOUR_MAPS))


def thumbnail_png(levels: NDArray[Any], *, full_scale: float, size: int, name: str) -> bytes:
    """A frame made small by averaging over its pixels, coloured from black to its full scale, as a PNG file.

    Parameters
    ----------
    levels
        Grey levels, shape (rows, columns).
    full_scale
        Grey level of the map's upper end.
    size
        Of the longer side in pixels, in [16, 1024]; a frame that is smaller stays as it is.
    name
        ``"grey"``, ``"cividis"``, ``"inferno"`` or ``"viridis"``.

    Raises
    ------
    InputError
        When the size lies outside its range.
    UnknownNameError
        When no map has that name.
    """
    require_integer("size", size, SMALLEST_PX, LARGEST_PX, hint="pixels of the longer side")
    require_one_of("colour map", name, MAPS)
    grey = levels.astype(np.float64)
    fraction = size / max(grey.shape)
    if fraction < 1.0:
        rows, columns = (max(1, round(side * fraction)) for side in grey.shape)
        grey = block_means(grey, (rows, columns))
    return _png(grey, full_scale, name)


def _png(grey: NDArray[np.float64], full_scale: float, name: str) -> bytes:
    if name == GREY:
        shown: NDArray[np.uint8] = np.rint(np.clip(grey / full_scale, 0.0, 1.0) * 255.0).astype(np.uint8)
    else:
        shown = colour_map(TactileImage(grey=grey, full_scale=full_scale), name=name)
    return encode_picture(shown)


FRAME_CACHE = "private, no-cache"  # a frame never changes, but who has logged out may not see it: the browser asks
NO_CACHE = "private, no-store"
Given = ParamSpec("Given")


def files_router(store: Store, reports: Reports | None = None, studies: StudyRepository | None = None) -> APIRouter:
    """Pictures of presses, reports and exports of targets of a store, reports of studies.

    Each answers with the file, or with one sentence as plain text. Without ``reports`` they are made here; without
    ``studies`` there are none of those.
    """
    router = APIRouter(prefix="/files", include_in_schema=False)

    @router.get("/press/{target}/{press}.png")
    @_in_a_sentence
    def picture(
        request: Request,
        target: str,
        press: str,
        size: int = Query(160, ge=SMALLEST_PX, le=LARGEST_PX),
        map_name: str = Query("viridis", alias="map"),
    ) -> Response:
        result = press_of(store, target, press)
        tag = f'"{result.frame}-{size}-{map_name}"'
        headers = {"etag": tag, "cache-control": FRAME_CACHE}
        if request.headers.get("if-none-match") == tag:
            return Response(status_code=304, headers=headers)
        content = thumbnail_png(store.levels(result.frame), full_scale=result.full_scale, size=size, name=map_name)
        return Response(content, media_type="image/png", headers=headers)

    @router.get("/report/{target}.{form}")
    @_in_a_sentence
    def report(target: str, form: str) -> Response:
        given = form_of("form of report", form, PAGE_FORMS)
        return _Sent(write_export(store, target_of(store, target), given, reports=reports), shown=given == "html")

    @router.get("/export/{target}/{form}")
    @_in_a_sentence
    def export(target: str, form: str, identified: bool = False) -> Response:
        given = form_of("form of export", form, ENDINGS)
        result = target_of(store, target)
        return _Sent(write_export(store, result, given, identified=identified, reports=reports), shown=False)

    if studies is not None:
        _add_study(router, studies)
    return router


def _add_study(router: APIRouter, studies: StudyRepository) -> None:
    @router.get("/study/{name}/report.{form}")
    @_in_a_sentence
    def study_report(name: str, form: str) -> Response:
        given = form_of("form of report", form, FORMS)
        content = report_bytes(studies.study(name), given)
        kind = "inline" if given == "html" else "attachment"
        headers = {"cache-control": NO_CACHE, "content-disposition": f'{kind}; filename="study-{name}.{given}"'}
        return Response(content, media_type=MEDIA_TYPES[f".{given}"], headers=headers)


class _Sent(FileResponse):
    """A file whose folder is removed when it was sent, or when nobody wants it any more."""

    def __init__(self, file: ExportFile, *, shown: bool) -> None:
        super().__init__(
            file.path,
            media_type=file.media_type,
            filename=file.path.name,
            content_disposition_type="inline" if shown else "attachment",
            headers={"cache-control": NO_CACHE},
        )
        self._file = file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._file.remove()


def _in_a_sentence(response: Callable[Given, Response]) -> Callable[Given, Response]:
    """An error as a sentence of plain text."""

    @wraps(response)
    def answered(*given: Given.args, **named: Given.kwargs) -> Response:
        try:
            return response(*given, **named)
        except TsisError as error:
            return PlainTextResponse(str(error), status_of(error), headers={"cache-control": NO_CACHE})

    return answered
