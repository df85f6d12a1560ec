"""Pagination of lists: ``?page=2&page_size=100``."""

from rest_framework import serializers
from rest_framework.pagination import PageNumberPagination
from rest_framework.request import Request
from rest_framework.response import Response


class Pages(PageNumberPagination):
    """Pages of 50 rows, or of ``page_size`` (1 to 100) rows."""

    page_size = 50
    page_size_query_param = "page_size"
    max_page_size = 100

    def get_page_size(self, request: Request) -> int:
        """Rows on a page. Raises ValidationError for anything but a whole number from 1 to 100."""
        asked = request.query_params.get(self.page_size_query_param)
        if asked is None:
            return self.page_size
        try:
            return serializers.IntegerField(min_value=1, max_value=self.max_page_size).run_validation(asked)
        except serializers.ValidationError as refused:
            raise serializers.ValidationError({self.page_size_query_param: refused.detail}) from None

    def get_paginated_response(self, data: list) -> Response:
        assert self.page is not None, "there is no page yet"
        return Response(
            {
                "count": self.page.paginator.count,
                "page": self.page.number,
                "pages": self.page.paginator.num_pages,
                "next": self.get_next_link(),
                "previous": self.get_previous_link(),
                "results": data,
            }
        )

    def get_paginated_response_schema(self, schema: dict[str, object]) -> dict[str, object]:
        whole = {"type": "integer", "minimum": 0}
        address = {"type": "string", "format": "uri", "nullable": True}
        return {
            "type": "object",
            "required": ["count", "page", "pages", "next", "previous", "results"],
            "properties": {
                "count": whole,
                "page": {"type": "integer", "minimum": 1},
                "pages": whole,
                "next": address,
                "previous": address,
                "results": schema,
            },
        }
