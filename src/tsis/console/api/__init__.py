"""Calls for scripts beside the pages: HTTP and JSON, described by OpenAPI. The models of pydantic end here."""

from tsis.console.api._application import PLACE, api_app

__all__ = ["PLACE", "api_app"]
