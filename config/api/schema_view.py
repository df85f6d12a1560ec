"""The OpenAPI description as JSON or YAML, generated once per process, language and format."""

from __future__ import annotations

from functools import lru_cache
from threading import Lock
from typing import Any

from django.conf import settings
from django.http import HttpResponse
from django.utils import translation
from drf_spectacular.generators import SchemaGenerator
from drf_spectacular.renderers import (
    OpenApiJsonRenderer,
    OpenApiJsonRenderer2,
    OpenApiYamlRenderer,
    OpenApiYamlRenderer2,
)
from drf_spectacular.utils import extend_schema
from rest_framework.permissions import AllowAny
from rest_framework.renderers import BaseRenderer
from rest_framework.request import Request
from rest_framework.views import APIView

_generating = Lock()


class SchemaView(APIView):
    """The schema, in the format that the header Accept prefers: JSON or YAML, also as ``application/vnd.oai.openapi``.

    ``?lang=`` selects the language of descriptions; otherwise it is the reader's.
    """

    authentication_classes = ()
    permission_classes = (AllowAny,)
    renderer_classes = (OpenApiJsonRenderer2, OpenApiJsonRenderer, OpenApiYamlRenderer, OpenApiYamlRenderer2)

    @extend_schema(exclude=True)
    def get(self, request: Request) -> HttpResponse:
        language = request.query_params.get("lang", "")
        if language not in dict(settings.LANGUAGES):
            language = translation.get_language()
        renderer = request.accepted_renderer
        body = schema_document(language, type(renderer))
        return HttpResponse(body, content_type=f"{renderer.media_type}; charset=utf-8", headers={"Vary": "Accept"})


def schema_in(language: str) -> dict[str, Any]:
    """The schema with its descriptions in ``language``. Callers must not change it."""
    with _generating:  # simultaneous first requests generate it once
        return _generate(language)


@lru_cache
def _generate(language: str) -> dict[str, Any]:
    with translation.override(language):
        return SchemaGenerator().get_schema(request=None, public=True)


@lru_cache
def schema_document(language: str, renderer: type[BaseRenderer]) -> bytes:
    """The schema as ``renderer`` writes it."""
    schema = schema_in(language)
    with translation.override(language):
        return renderer().render(schema, renderer_context={})
