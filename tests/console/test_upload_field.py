"""A field for files, and what is left of it when its page is closed."""

from __future__ import annotations

import gc
import weakref

from nicegui import Client, ui

from tsis.console.widgets import FileField


class Page:
    """What a page would be, with an act that a field calls."""

    def taken(self, _: object) -> None: ...


def test_a_deleted_field_keeps_nothing_of_its_page() -> None:
    page = Page()
    client = Client(ui.page("/"), request=None)
    with client:
        field = FileField(on_upload=page.taken, on_begin_upload=page.taken, on_multi_upload=page.taken)
    left = weakref.ref(page)
    field.delete()
    del page
    gc.collect()
    assert field.is_deleted
    assert left() is None
