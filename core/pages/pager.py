"""Pages of a long list."""

from django.core.paginator import Page, Paginator


class LeanPaginator(Paginator):
    """A paginator that does not count the rows when the first page has them all."""

    def get_page(self, number: int | float | str | None) -> Page:
        if number not in (None, "", 1, "1") or not hasattr(self.object_list, "query"):
            return super().get_page(number)
        rows = list(self.object_list[: self.per_page + 1])
        if len(rows) <= self.per_page:
            self.count = len(rows)
        return Page(rows[: self.per_page], 1, self)
