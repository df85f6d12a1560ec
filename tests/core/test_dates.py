"""Dates in one style, in the reader's time zone and language."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from django.utils import timezone
from django.utils.translation import override

from core import times
from core.templatetags import formats

NOW = datetime(2026, 11, 28, 14, 32, tzinfo=UTC)
SEOUL = ZoneInfo("Asia/Seoul")


@pytest.fixture(autouse=True)
def today(monkeypatch):
    monkeypatch.setattr(timezone, "now", lambda: NOW)


@pytest.mark.parametrize(
    ("language", "moment", "text"),
    [
        ("en", NOW, "Sat 28 Nov, 23:32 KST"),
        ("ko", NOW, "11월 28일 (토) 23:32 KST"),
        ("en", datetime(2021, 6, 11, 3, 0, tzinfo=UTC), "Fri 11 Jun 2021, 12:00 KST"),
        ("ko", datetime(2021, 6, 11, 3, 0, tzinfo=UTC), "2021년 6월 11일 (금) 12:00 KST"),
    ],
)
def test_a_moment_names_day_time_and_zone(language, moment, text):
    with override(language), timezone.override(SEOUL):
        assert times.written(moment) == text
        assert times.for_the_reader(times.stored(moment)) == text
        assert text in formats.moment(moment)


def test_a_day_names_the_year_where_it_is_another():
    with override("en"):
        assert times.written_day(date(2026, 11, 28)) == "Sat 28 Nov"
        assert times.written_day(date(2021, 6, 11)) == "11 June 2021"
        assert formats.month(date(2021, 6, 11)) == "June 2021"
    with override("ko"):
        assert times.written_day(date(2026, 11, 28)) == "11월 28일 (토)"
        assert times.written_day(date(2021, 6, 11)) == "2021년 6월 11일"


@pytest.mark.parametrize(
    ("before", "text"),
    [
        (timedelta(days=1996), ">11 June 2021<"),
        (timedelta(days=29), ">29 d ago<"),
        (timedelta(days=30), ">Thu 29 Oct<"),
    ],
)
def test_what_is_long_ago_is_a_day(before, text):
    with override("en"):
        assert text in formats.ago(NOW - before)
