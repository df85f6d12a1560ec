"""A race's board for programs, feed readers and other sites."""

from django.http import HttpRequest, HttpResponse, JsonResponse
from django.utils import timezone
from django.utils.feedgenerator import Atom1Feed
from django.utils.translation import gettext as _
from django.views.decorators.http import require_safe

from races.boards import exports
from races.boards.selectors.board import board, podiums
from races.models import Race, Visibility
from races.pages.badge import badge
from races.rules.descriptions import score_words
from races.web.names import named

from ...web.views import downloaded, visible_race


@require_safe
def board_csv(request: HttpRequest, slug: str) -> HttpResponse:
    race = visible_race(request, slug)
    return downloaded("".join(exports.board_csv(race)), f"{race.slug}.csv", "text/csv; charset=utf-8")


@require_safe
def board_json(request: HttpRequest, slug: str) -> HttpResponse:
    data = exports.board_data(visible_race(request, slug), timezone.now())
    return JsonResponse(data, json_dumps_params={"indent": 1})


@require_safe
def board_atom(request: HttpRequest, slug: str) -> HttpResponse:
    """The first page of the board as an Atom feed; an improvement is a new feed entry."""
    race = visible_race(request, slug)
    address = request.build_absolute_uri(race.get_absolute_url())
    feed = Atom1Feed(
        title=_("Board of %(race)s") % {"race": named(race.name)},
        link=address,
        description=race.track.name,
        feed_url=request.build_absolute_uri(),
        feed_guid=address,
    )
    for row in board(race).rows:
        if row.rank is None or row.is_baseline:
            continue
        at = row.entry.achieved_at
        feed.add_item(
            title=_("%(rank)s. %(racer)s, %(score)s")
            % {"rank": row.rank, "racer": row.alias, "score": score_words(row.entry)},
            link=address,
            description="",
            author_name=row.alias,
            unique_id=f"{address}#{row.entry.pk}-{'' if at is None else f'{at:%Y%m%d%H%M%S}'}",
            updateddate=at or race.opens_at,
            pubdate=at or race.opens_at,
        )
    return _cached(HttpResponse(feed.writeString("utf-8"), content_type=feed.content_type), race)


@require_safe
def board_badge(request: HttpRequest, slug: str) -> HttpResponse:
    """The race's leader, or the rank of ``racer``, as an SVG image."""
    race = visible_race(request, slug)
    alias = request.GET.get("racer", "")
    value = _rank_words(race, alias) if alias else _leader_words(race)
    image = badge(named(race.name), value or _("no racer classified"), good=bool(value))
    return _cached(HttpResponse(image, content_type="image/svg+xml"), race)


def _leader_words(race: Race) -> str:
    rows = podiums([race], size=1)[race.pk]
    return f"{rows[0].alias} {score_words(rows[0].entry)}" if rows else ""


def _rank_words(race: Race, alias: str) -> str:
    entry = race.entries.filter(racer__alias__iexact=alias, withdrawn_at=None).select_related("racer").first()
    if entry is None:
        return ""
    row = board(race, entry.racer, per_page=1).my_row
    if row is None or row.rank is None:
        return ""
    return _("%(racer)s: place %(rank)s, %(score)s") % {
        "racer": row.alias,
        "rank": row.rank,
        "score": score_words(row.entry),
    }


def _cached(response: HttpResponse, race: Race) -> HttpResponse:
    """Cache public boards for a minute, as other sites poll them often, and others never."""
    public = race.visibility == Visibility.PUBLIC
    response["Cache-Control"] = "public, max-age=60" if public else "private, no-store"
    return response
