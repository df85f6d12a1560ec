"""The schema of the API, generated once for all that is tried of it: the one that the site answers with."""

from __future__ import annotations

from config.api.schema_view import schema_in

SCHEMA = schema_in("en")
