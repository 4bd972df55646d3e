"""Files that pages link to: pictures, reports, exports."""

from __future__ import annotations

import re
import shutil
import tempfile
from contextlib import ExitStack
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, ParamSpec

import numpy as np
from fastapi import APIRouter, Query, Request, Response
from starlette.responses import FileResponse, PlainTextResponse

from tsis.__about__ import LARGEST_TARGET
from tsis.calibration.frames import read_press_image
from tsis.console.statuses import AbsentError, absent_if_unknown, status_of
from tsis.console.studies import FORMS, report_bytes
from tsis.console.worker import WorkerProcess
from tsis.errors import FileInputError, InputError, TsisError
from tsis.files.frame_names import target_folder
from tsis.files.images import encode_picture
from tsis.files.tables import table_bytes
from tsis.imaging.colour import COLOUR_MAPS, colour_map
from tsis.imaging.pixels import block_means
from tsis.model.image import TactileImage
from tsis.model.require import require_integer, require_one_of
from tsis.present.records import ENDINGS, MASKED, PAGE_FORMS, StoreAddress, report_of_stored_target, write_form
from tsis.present.target import result_rows
from tsis.records.export import export_file

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence
    from typing import Any

    from numpy.typing import NDArray
    from starlette.types import Receive, Scope, Send

    from tsis.console.studies import StudyRepository
    from tsis.records.store import Store
    from tsis.records.values import StoredPress, Target


MOST_DIGITS = 20  # that are turned into a number at all


def target_of(store: Store, text: str) -> Target:
    """The target whose number stands in an address; `AbsentError` when there is none."""
    if not (text.isascii() and text.isdigit() and len(text) <= MOST_DIGITS):
        raise AbsentError(f"target must be a number from 1 to {LARGEST_TARGET}; got {text!r:.40}")
    with absent_if_unknown():
        return store.target(int(text))


def press_of(store: Store, target: str, press: str) -> StoredPress:
    """The press whose identity stands in an address; `AbsentError` when there is none."""
    owner = target_of(store, target)
    with absent_if_unknown():
        return store.press(owner, press)


def form_of(name: str, text: str, forms: Collection[str]) -> str:
    """The form that stands in an address; `AbsentError` when there is none of that name."""
    with absent_if_unknown():
        return require_one_of(name, text, forms)


SMALLEST_PX, LARGEST_PX = 16, 1024  # of the longer side
GREY = "grey"
MAPS = (GREY, *sorted(COLOUR_MAPS))


def thumbnail_png(levels: NDArray[Any], *, full_scale: float, size: int, name: str) -> bytes:
    """A frame reduced by averaging over its pixels, coloured from black to its full scale, as a PNG file.

    Parameters
    ----------
    levels
        Grey levels, shape (rows, columns).
    full_scale
        Grey level of the map's upper end.
    size
        Longer side in pixels, in [16, 1024], else `InputError`; a smaller frame stays as it is.
    name
        ``"grey"``, ``"cividis"``, ``"inferno"`` or ``"viridis"``, else `UnknownNameError`.
    """
    require_integer("size", size, SMALLEST_PX, LARGEST_PX, hint="pixels of the longer side")
    require_one_of("colour map", name, MAPS)
    grey = levels.astype(np.float64)
    shrinking = size / max(grey.shape)
    if shrinking < 1.0:
        rows, columns = (max(1, round(side * shrinking)) for side in grey.shape)
        grey = block_means(grey, (rows, columns))
    if name == GREY:
        return encode_picture(np.rint(np.clip(grey / full_scale, 0.0, 1.0) * 255.0).astype(np.uint8))
    return encode_picture(colour_map(TactileImage(grey=grey, full_scale=full_scale), name=name))


MOST_AT_ONCE = 100  # targets of one export
SEQUENCE = re.compile(r"sequence(-[0-9]{1,6})?")  # names of the folders of recorded sequences
FRAME_CACHE = "private, no-cache"  # a frame never changes, but who has logged out may not see it: the browser asks
NO_CACHE = "private, no-store"
Arguments = ParamSpec("Arguments")


def sequence_folders(workspace: Path, target: int) -> dict[str, int]:
    """Names of the recorded sequences of a target, in their order, with the number of frames in each."""
    folders = [item for item in (workspace / target_folder(target)).glob("sequence*") if SEQUENCE.fullmatch(item.name)]
    return {item.name: sum(1 for _ in item.glob("frame-*.png")) for item in sorted(folders) if item.is_dir()}


def sequence_frame(workspace: Path, target: int, name: str, number: int) -> TactileImage:
    """A frame of a recorded sequence, numbered from 0; `AbsentError` when there is none."""
    with absent_if_unknown():
        require_one_of("sequence", name, sequence_folders(workspace, target))
    file = workspace / target_folder(target) / name / f"frame-{number:06d}.png"
    if not file.is_file():
        raise AbsentError(f"frame must be one of {name}; there is none of the number {number}")
    return read_press_image(file)


def sequence_archive(workspace: Path, target: int, name: str) -> Path:
    """A zip file of a recorded sequence in a new folder; `AbsentError` when there is none of that name."""
    with absent_if_unknown():
        require_one_of("sequence", name, sequence_folders(workspace, target))
    folder = Path(tempfile.mkdtemp(prefix="tsis-export-"))
    try:
        parent = workspace / target_folder(target)
        return Path(shutil.make_archive(str(folder / f"target-{target}-{name}"), "zip", parent, name))
    except OSError as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise FileInputError(f"a zip file of {name} must be writable; got: {error.strerror or error}") from error


def files_router(
    store: Store,
    reports: Reports | None = None,
    studies: StudyRepository | None = None,
    *,
    workspace: Path | None = None,
) -> APIRouter:
    """Pictures of presses, reports and exports of targets of a store, reports of studies, recorded sequences.

    Each responds with the file, or with a message as plain text. Without ``reports`` they are built here; without
    ``studies`` there are none of those, and without ``workspace`` no sequences.
    """
    router = APIRouter(prefix="/files", include_in_schema=False)

    @router.get("/press/{target}/{press}.png")
    @_errors_as_text
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
    @_errors_as_text
    def report(target: str, form: str) -> Response:
        kind = form_of("form of report", form, PAGE_FORMS)
        return _Sent(write_export(store, target_of(store, target), kind, reports=reports), shown=kind == "html")

    @router.get("/export/{target}/{form}")
    @_errors_as_text
    def export(target: str, form: str, identified: bool = False) -> Response:
        kind = form_of("form of export", form, ENDINGS)
        owner = target_of(store, target)
        return _Sent(write_export(store, owner, kind, identified=identified, reports=reports), shown=False)

    @router.get("/exports/{form}")
    @_errors_as_text
    def exports(form: str, targets: str, identified: bool = False) -> Response:
        kind = form_of("form of export", form, ENDINGS)
        owners = [target_of(store, number) for number in dict.fromkeys(targets.split(",")[: MOST_AT_ONCE + 1])]
        return _Sent(write_exports(store, owners, kind, identified=identified, reports=reports), shown=False)

    @router.get("/targets.csv")
    @_errors_as_text
    def results() -> Response:
        records = (store.record(item.target, limit=0) for item in store.targets())
        content = table_bytes(result_rows(records))
        headers = {"cache-control": NO_CACHE, "content-disposition": 'attachment; filename="targets.csv"'}
        return Response(content, media_type="text/csv; charset=utf-8", headers=headers)

    @router.get("/sequence/{target}/{name}.zip")
    @_errors_as_text
    def sequence(target: str, name: str) -> Response:
        number = target_of(store, target).number
        if workspace is None:
            raise AbsentError("sequences lie in a workspace; there is none")
        return _Sent(sequence_archive(workspace, number, name), shown=False)

    @router.get("/sequence/{target}/{name}/{number}.png")
    @_errors_as_text
    def frame_of_sequence(
        target: str, name: str, number: int, size: int = Query(768, ge=SMALLEST_PX, le=LARGEST_PX)
    ) -> Response:
        if workspace is None:
            raise AbsentError("sequences lie in a workspace; there is none")
        image = sequence_frame(workspace, target_of(store, target).number, name, number)
        content = thumbnail_png(image.grey, full_scale=image.full_scale, size=size, name="viridis")
        return Response(content, media_type="image/png", headers={"cache-control": NO_CACHE})

    if studies is None:
        return router

    @router.get("/study/{name}/report.{form}")
    @_errors_as_text
    def study_report(name: str, form: str) -> Response:
        form_name = form_of("form of report", form, FORMS)
        content = report_bytes(studies.study(name), form_name)
        kind = "inline" if form_name == "html" else "attachment"
        headers = {"cache-control": NO_CACHE, "content-disposition": f'{kind}; filename="study-{name}.{form_name}"'}
        return Response(content, media_type=MEDIA_TYPES[f".{form_name}"], headers=headers)

    return router


class _Sent(FileResponse):
    """A file whose folder is removed after it was sent, or after the connection was closed."""

    def __init__(self, file: Path, *, shown: bool) -> None:
        super().__init__(
            file,
            media_type=MEDIA_TYPES[file.suffix],
            filename=file.name,
            content_disposition_type="inline" if shown else "attachment",
            headers={"cache-control": NO_CACHE},
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            shutil.rmtree(Path(self.path).parent, ignore_errors=True)


def _errors_as_text(route: Callable[Arguments, Response]) -> Callable[Arguments, Response]:
    """A route whose errors are messages of plain text."""

    @wraps(route)
    def response(*given: Arguments.args, **named: Arguments.kwargs) -> Response:
        try:
            return route(*given, **named)
        except TsisError as error:
            return PlainTextResponse(str(error), status_of(error), headers={"cache-control": NO_CACHE})

    return response


MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".pdf": "application/pdf",
    ".nc": "application/x-netcdf",
    ".zip": "application/zip",
}


def write_export(
    store: Store, target: Target, form: str, *, identified: bool = False, reports: Reports | None = None
) -> Path:
    """Write a form of `tsis.present.records.ENDINGS` of a target into its own new folder; a folder becomes a zip file.

    With ``identified`` dicom includes label, names and true times; other forms mask nothing. Without
    ``reports`` html and pdf are built in this process.

    Raises
    ------
    InputError
        When the form masks nothing and ``identified`` is set.
    FileInputError
        When it cannot be written.
    MissingExtraError
        When the form needs an extra that is not installed.
    RecordsError
        When a stored file is damaged; html and pdf say so in their text instead.
    """
    if identified and form not in MASKED:
        raise InputError(f"identified is of {' and '.join(MASKED)}; {form} masks nothing (leave it out)")
    folder = _export_folder()
    try:
        path = folder / f"target-{target.number}{ENDINGS[form]}"
        if reports is not None and form in PAGE_FORMS:
            reports.write(target, form, path)
        else:
            record = store.record(target)
            if form not in PAGE_FORMS:
                record.require_whole()
            write_form(form, record, path, identified=identified)
        return _one_file(path)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def write_exports(
    store: Store, targets: Sequence[Target], form: str, *, identified: bool = False, reports: Reports | None = None
) -> Path:
    """Write a form of at most `MOST_AT_ONCE` targets as one zip file; parameters and errors as of `write_export`."""
    if not 1 <= len(targets) <= MOST_AT_ONCE:
        raise InputError(
            f"targets must be 1 to {MOST_AT_ONCE} at once; got {len(targets)} or more (narrow the search, "
            "or back up the store)"
        )
    with ExitStack() as failed:
        folder = _export_folder()
        failed.callback(shutil.rmtree, folder, ignore_errors=True)
        whole = folder / "targets"
        whole.mkdir()
        for target in targets:
            file = write_export(store, target, form, identified=identified, reports=reports)
            shutil.move(file, whole / file.name)
            shutil.rmtree(file.parent, ignore_errors=True)
        packed = _one_file(whole)
        failed.pop_all()
    return packed


def _export_folder() -> Path:
    try:
        return Path(tempfile.mkdtemp(prefix="tsis-export-"))
    except OSError as error:
        raise FileInputError(f"a folder for the export must be writable; got: {error.strerror or error}") from error


def _one_file(path: Path) -> Path:
    """The file itself; of a folder a zip file of it."""
    if path.is_file():
        return path
    try:
        packed = Path(shutil.make_archive(str(path), "zip", path.parent, path.name))
    except OSError as error:
        raise FileInputError(f"a zip file of {path.name} must be writable; got: {error.strerror or error}") from error
    shutil.rmtree(path, ignore_errors=True)
    return packed


class Reports:
    """Builds the reports of a store, one at a time, in a worker process."""

    def __init__(self, store: Store, *, database: str | None = None, worker: WorkerProcess | None = None) -> None:
        self._folder = StoreAddress(folder=store.folder, kind=store.kind, database=database, identity=store.identity)
        self._worker = worker or WorkerProcess()

    def content(self, target: Target, form: str) -> bytes:
        """The report in a form of `tsis.present.records.PAGE_FORMS`; errors as `report_of_stored_target`."""
        return self._worker.call(report_of_stored_target, self._folder, target.number, form)

    def write(self, target: Target, form: str, path: Path) -> None:
        """The same as a new file; also `FileInputError` when it cannot be written."""
        content = self.content(target, form)
        with export_file(path) as draft:
            draft.write_bytes(content)

    def close(self) -> None:
        """Make none any more."""
        self._worker.close()
