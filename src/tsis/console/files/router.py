"""Addresses of files. Names in them are looked up in the store and never become part of a path."""

from __future__ import annotations

from functools import wraps
from typing import TYPE_CHECKING, ParamSpec

from fastapi import APIRouter, Query, Request, Response
from starlette.responses import FileResponse, PlainTextResponse

from tsis.console.files.asked import form_of, press_of, target_of
from tsis.console.files.exporting import MEDIA_TYPES, Written, written
from tsis.console.files.thumbnail import LARGEST_PX, SMALLEST_PX, thumbnail_png
from tsis.console.statuses import status_of
from tsis.console.studies.reports import FORMS, report_bytes
from tsis.model.errors import TsisError
from tsis.report.forms import ENDINGS, PAGES

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.types import Receive, Scope, Send

    from tsis.console.files.reports import Reports
    from tsis.console.studies import StudyShelf
    from tsis.records import Store

FRAME_CACHE = "private, no-cache"  # a frame never changes, but who has logged out may not see it: the browser asks
NO_CACHE = "private, no-store"
Given = ParamSpec("Given")


def files_router(store: Store, reports: Reports | None = None, studies: StudyShelf | None = None) -> APIRouter:
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
        found = press_of(store, target, press)
        tag = f'"{found.frame}-{size}-{map_name}"'
        headers = {"etag": tag, "cache-control": FRAME_CACHE}
        if request.headers.get("if-none-match") == tag:
            return Response(status_code=304, headers=headers)
        content = thumbnail_png(store.levels(found.frame), full_scale=found.full_scale, size=size, name=map_name)
        return Response(content, media_type="image/png", headers=headers)

    @router.get("/report/{target}.{form}")
    @_in_a_sentence
    def report(target: str, form: str) -> Response:
        known = form_of("form of report", form, PAGES)
        return _Sent(written(store, target_of(store, target), known, reports=reports), shown=known == "html")

    @router.get("/export/{target}/{form}")
    @_in_a_sentence
    def export(target: str, form: str, identified: bool = False) -> Response:
        known = form_of("form of export", form, ENDINGS)
        found = target_of(store, target)
        return _Sent(written(store, found, known, identified=identified, reports=reports), shown=False)

    if studies is not None:
        _add_study(router, studies)
    return router


def _add_study(router: APIRouter, studies: StudyShelf) -> None:
    @router.get("/study/{name}/report.{form}")
    @_in_a_sentence
    def study_report(name: str, form: str) -> Response:
        known = form_of("form of report", form, FORMS)
        content = report_bytes(studies.study(name), known)
        kind = "inline" if known == "html" else "attachment"
        headers = {"cache-control": NO_CACHE, "content-disposition": f'{kind}; filename="study-{name}.{known}"'}
        return Response(content, media_type=MEDIA_TYPES[f".{known}"], headers=headers)


class _Sent(FileResponse):
    """A file whose folder is removed when it was sent, or when nobody wants it any more."""

    def __init__(self, file: Written, *, shown: bool) -> None:
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


def _in_a_sentence(answer: Callable[Given, Response]) -> Callable[Given, Response]:
    """An error as a sentence of plain text."""

    @wraps(answer)
    def answered(*given: Given.args, **named: Given.kwargs) -> Response:
        try:
            return answer(*given, **named)
        except TsisError as error:
            return PlainTextResponse(str(error), status_of(error), headers={"cache-control": NO_CACHE})

    return answered
