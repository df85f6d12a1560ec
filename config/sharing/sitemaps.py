"""The site maps: public pages by kind, in parts of bounded size."""

from __future__ import annotations

from datetime import datetime
from operator import attrgetter
from typing import Any
from urllib.parse import urlsplit

from django.conf import settings
from django.contrib.sitemaps import Sitemap
from django.core.paginator import EmptyPage
from django.urls import reverse

from core.cards.registry import CardKind, card_kinds

from ..guides.pages import GUIDES

PART = 5000  # addresses in one file
_PAGES = ("home", "races", "seasons", "cups", "hall", "tracks", "learn", "about", "guides")


class SiteMap(Sitemap):
    """A part of the map of the site at its own address."""

    limit = PART

    def get_protocol(self, protocol: str | None = None) -> str:
        return urlsplit(settings.SITE_URL).scheme

    def get_domain(self, site: Any = None) -> str:
        return settings.SITE_URL.partition("://")[2]

    def part(self, number: int) -> list[dict[str, object]] | None:
        """The addresses of a part, from 1; None where there is no such part."""
        try:
            return self.get_urls(number)
        except EmptyPage:
            return None


class _PagesOfSite(SiteMap):
    def items(self) -> list[str]:
        return [*map(reverse, _PAGES), *(reverse("guide", args=[guide.slug]) for guide in GUIDES)]

    def location(self, item: str) -> str:
        return item


class _PagesOfKind(SiteMap):
    def __init__(self, kind: CardKind) -> None:
        self._kind, self._key = kind, attrgetter(kind.argument)

    def items(self) -> Any:
        return self._kind.public()

    def location(self, item: Any) -> str:
        return self._kind.address(self._key(item))

    def lastmod(self, item: Any) -> datetime | None:
        return getattr(item, self._kind.changed) if self._kind.changed else None


def site_maps() -> dict[str, SiteMap]:
    """The maps by the name of their kind of page."""
    return {"pages": _PagesOfSite()} | {name: _PagesOfKind(kind) for name, kind in card_kinds().items()}
