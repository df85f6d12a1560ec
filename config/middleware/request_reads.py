"""Records which headers, cookies and query parameters of a request a view reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from django.http import HttpRequest, QueryDict
from django.http.request import HttpHeaders
from django.utils.encoding import escape_uri_path

EVERYTHING = "*"
WHOLE_QUERY = "QUERY_STRING"
_QUERY = "query:"
Note = Callable[[str], None]


class _Recorded(dict):
    """A dict that reports each name that is read."""

    def __init__(self, content: Mapping[str, object], note: Note) -> None:
        super().__init__(content)
        self._note = note

    def __getitem__(self, name: str) -> Any:
        self._note(name)
        return super().__getitem__(name)

    def __contains__(self, name: object) -> bool:
        self._note(str(name))
        return super().__contains__(name)

    def get(self, name: str, default: Any = None) -> Any:
        self._note(name)
        return super().get(name, default)

    def pop(self, name: str, *default: Any) -> Any:
        self._note(name)
        return super().pop(name, *default)


def _reading_everything(name: str) -> Callable[[_Recorded], Any]:
    def read(self: _Recorded) -> Any:
        self._note(EVERYTHING)
        return getattr(dict, name)(self)

    return read


for _name in ("__iter__", "keys", "values", "items", "copy"):
    setattr(_Recorded, _name, _reading_everything(_name))


class _RecordedHeaders(HttpHeaders):
    """Headers that report each name that is read, as it stands in META."""

    def __init__(self, environ: Mapping[str, object], note: Note) -> None:
        super().__init__(environ)
        self._note = note

    def __getitem__(self, name: str) -> str:
        self._note(self.to_wsgi_name(name))
        return super().__getitem__(name)

    def __iter__(self) -> Iterator[str]:
        self._note(EVERYTHING)
        return super().__iter__()


class _RecordedQuery(QueryDict):
    """Query parameters that report each name that is read, and the whole query where more than one name is read."""

    _note: Note = staticmethod(lambda name: None)  # a copy's
    _reads: set[str] = set()

    @classmethod
    def of(cls, query: QueryDict, reads: set[str]) -> _RecordedQuery:
        recorded = cls("", mutable=True, encoding=query.encoding)
        for name, values in query.lists():
            recorded.setlist(name, values)
        recorded._mutable, recorded._note, recorded._reads = False, reads.add, reads
        return recorded

    @property
    def read_so_far(self) -> QueryDict:
        known = QueryDict("", mutable=True, encoding=self.encoding)
        for name in sorted(query_names(self._reads)):
            if QueryDict.__contains__(self, name):
                known.setlist(name, QueryDict.getlist(self, name))
        return known

    def __getitem__(self, name: str) -> Any:
        self._note(_QUERY + name)
        return super().__getitem__(name)

    def __contains__(self, name: object) -> bool:
        self._note(f"{_QUERY}{name}")
        return super().__contains__(name)

    def getlist(self, name: str, default: Any = None) -> Any:
        self._note(_QUERY + name)
        return super().getlist(name, default)


def _reading_the_query(name: str) -> Callable[..., Any]:
    def read(self: _RecordedQuery, *arguments: Any, **options: Any) -> Any:
        self._note(WHOLE_QUERY)
        return getattr(QueryDict, name)(self, *arguments, **options)

    return read


for _name in (
    *("__iter__", "__len__", "__eq__", "__or__", "keys", "values", "items", "lists", "dict", "copy", "urlencode"),
):
    setattr(_RecordedQuery, _name, _reading_the_query(_name))


def record_reads(request: HttpRequest) -> set[str]:
    """From now on, record what is read of a request: a name of META, ``cookie:NAME``, ``query:NAME``, or
    :data:`EVERYTHING`. ``get_full_path`` then has only the parameters read so far."""
    reads: set[str] = set()
    plain = dict(request.META)
    request.COOKIES = _Recorded(request.COOKIES, lambda name: reads.add(f"cookie:{name}"))
    request.headers = _RecordedHeaders(plain, reads.add)
    query, whole_path = _RecordedQuery.of(request.GET, reads), request.get_full_path
    request.GET = query  # type: ignore[assignment]
    request.META = _Recorded(plain, reads.add)
    if hasattr(request, "environ"):
        request.environ = request.META

    def path_of_reads(force_append_slash: bool = False) -> str:
        if force_append_slash:
            return whole_path(force_append_slash=True)
        known = query.read_so_far.urlencode()
        return escape_uri_path(request.path) + (f"?{known}" if known else "")

    request.get_full_path = path_of_reads  # type: ignore[method-assign]
    return reads


def query_names(reads: Iterable[str]) -> frozenset[str]:
    return frozenset(read.removeprefix(_QUERY) for read in reads if read.startswith(_QUERY))


def values_of(query: QueryDict, names: Iterable[str]) -> list[tuple[str, list[str]]]:
    return [(name, query.getlist(name)) for name in sorted(names) if name in query]
