"""The OpenAPI description as JSON or YAML, generated once per process, language and format."""

from functools import lru_cache
from threading import Lock

from django.conf import settings
from django.http import HttpResponse
from django.utils import translation
from django.utils.encoding import force_bytes
from drf_spectacular.generators import SchemaGenerator
from drf_spectacular.renderers import (
    OpenApiJsonRenderer,
    OpenApiJsonRenderer2,
    OpenApiYamlRenderer,
    OpenApiYamlRenderer2,
)
from drf_spectacular.utils import extend_schema
from rest_framework.permissions import AllowAny
from rest_framework.request import Request

from core.api.views import APIView

from .schema import SchemaDocument

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
        media_type = str(request.accepted_renderer.media_type)
        body = schema_document(language, media_type)
        return HttpResponse(body, content_type=f"{media_type}; charset=utf-8", headers={"Vary": "Accept"})


def schema_in(language: str) -> SchemaDocument:
    """The schema with its descriptions in ``language``. Callers must not change it."""
    with _generating:  # simultaneous first requests generate it once
        return _generate(language)


@lru_cache
def _generate(language: str) -> SchemaDocument:
    with translation.override(language):
        return SchemaGenerator().get_schema(request=None, public=True)


@lru_cache
def schema_document(language: str, media_type: str) -> bytes:
    schema = schema_in(language)
    renderer = next(each for each in SchemaView.renderer_classes if each.media_type == media_type)
    with translation.override(language):
        return force_bytes(renderer().render(schema, renderer_context={}))
