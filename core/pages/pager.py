"""Pages of a long list."""

from collections.abc import Callable, Sequence
from typing import Any

from django.core.paginator import Page, Paginator
from django.db.models import QuerySet


class LeanPaginator(Paginator):
    """A paginator that does not count the rows when the first page has them all."""

    def get_page(self, number: int | float | str | None) -> Page:
        if number not in (None, "", 1, "1") or not hasattr(self.object_list, "query"):
            return super().get_page(number)
        rows = list(self.object_list[: self.per_page + 1])
        if len(rows) <= self.per_page:
            self.count = len(rows)
        return Page(rows[: self.per_page], 1, self)


def kept_pages(
    number: str | None, per_page: int, first: Callable[[], Sequence[Any]] | None, every: Callable[[], QuerySet[Any]]
) -> Page:
    """A page of ``every``. ``first``, where given, reads the rows of the first page and one more by a kept query."""
    if first is None or number not in (None, "", "1"):
        return LeanPaginator(every(), per_page).get_page(number)
    rows = first()
    return Page(rows[:per_page], 1, LeanPaginator(rows if len(rows) <= per_page else every(), per_page))
