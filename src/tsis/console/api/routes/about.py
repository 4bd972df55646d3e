"""The program."""

from __future__ import annotations

from fastapi import APIRouter

from tsis.console.api.asking import TheBench
from tsis.console.api.models.about import AboutAnswer, StoreTold
from tsis.records import environment

about_router = APIRouter(tags=["about"])


@about_router.get("/about", operation_id="get_about")
def get_about(bench: TheBench) -> AboutAnswer:
    """Tell versions, and where records and files are kept."""
    store = bench.store
    return AboutAnswer(
        environment=environment(),
        store=StoreTold(folder=str(store.folder.resolve()), kind=store.kind, identity=store.identity),
        workspace=str(bench.terms.workspace.resolve()),
    )
