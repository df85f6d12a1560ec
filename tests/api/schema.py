"""The schema of the API, worked out once for all that is tried of it."""

from __future__ import annotations

from drf_spectacular.generators import SchemaGenerator

SCHEMA = SchemaGenerator().get_schema(request=None, public=True)
