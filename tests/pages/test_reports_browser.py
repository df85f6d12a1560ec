"""A report on a car in a real browser: one press, progress that moves by itself, the result, two side by side."""

from __future__ import annotations

import os
from collections.abc import Iterator
from datetime import timedelta
from itertools import product

import pytest
from django.utils import timezone

from evaluation.models.reports import CarReport
from evaluation.reports.jobs import CHUNKS, finish_chunk
from tests.evaluation.reports import a_report, drive, off_the_road, outcome_of
from tests.factories import a_model, a_track
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.wakeups import heard

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


def test_one_press_drives_a_report_that_moves_by_itself(browser, live_server, alice, wakes, monkeypatch):
    heard(monkeypatch, "evaluation.tasks.drive_reports")
    now = timezone.now()
    model = a_model(alice, name="Lightning")
    a_track()
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        page.goto(f"/models/{model.public_id}/")
        page.get_by_role("button", name="Drive a report").click()
        page.wait_for_url("**/reports/*/")
        report = CarReport.objects.get()
        page.get_by_text("In queue").first.wait_for()

        chunk = CHUNKS.claim(worker="w", now=now)
        finish_chunk(pk=chunk.pk, lease=chunk.lease, outcome=outcome_of(chunk, off_the_road(19)), now=now)
        page.locator("#live .big-time", has_text=f"{100 * 20 // report.laps.count()} %").wait_for()
        drive(report, now, off_the_road(19, 39, 99))
        page.locator("#worth .grade-pill", has_text="A").wait_for()
        assert page.locator("#variations .out").count() == 3
        assert (
            page.locator("#variations tbody tr").first.inner_text().replace("\t", " ").startswith("Start 19 / 20 95 %")
        )

        page.get_by_role("button", name="Drive again").click()
        page.wait_for_url(lambda address: report.public_id not in address)
        page.get_by_role("button", name="Stop").click()
        page.get_by_text("stopped").first.wait_for()
        page.get_by_role("link", name="Delete").click()
        page.get_by_role("button", name="Delete").click()
        page.get_by_text("Report deleted.").wait_for()
        assert page.locator("#quotas").inner_text().count("/") == 3


def test_chosen_tracks_are_ticked_and_a_refusal_stands_beside_its_field(
    browser, live_server, alice, wakes, monkeypatch
):
    heard(monkeypatch, "evaluation.tasks.drive_reports")
    model = a_model(alice)
    a_track()
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        page.goto(f"/reports/new/?model={model.public_id}")
        page.get_by_label("Tracks", exact=True).select_option("chosen")
        page.get_by_label("A hundred variations of a lap of").select_option("")
        page.get_by_role("button", name="Drive", exact=True).click()
        page.locator('[data-code="report_tracks"], .errors').first.wait_for()
        assert page.locator(".chosen-tracks .errors").count() == 1 and not CarReport.objects.exists()
        page.get_by_label("Paddock Oval").check()
        page.get_by_role("button", name="Drive", exact=True).click()
        page.wait_for_url("**/reports/*/")
        assert CarReport.objects.get().laps.count() == 2


def test_two_reports_stand_side_by_side_at_every_width(browser, live_server, alice, wakes, monkeypatch):
    heard(monkeypatch, "evaluation.tasks.drive_reports")
    now = timezone.now()
    a_track()
    first = drive(
        a_report(alice, now, model=a_model(alice, name="Lightning")), now, off_the_road(19, 38, 39, 97, 98, 99)
    )
    other = drive(a_report(alice, now - timedelta(hours=1), model=a_model(alice, name="Thunder")), now)
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        for width, theme in product((360, 1280), ("dark", "light")):
            page.set_viewport_size({"width": width, "height": 900})
            page.emulate_media(color_scheme=theme)
            page.goto(f"/reports/{first.public_id}/?with={other.public_id}")
            beside = page.locator("#compare tbody tr", has_text="All variations").inner_text()
            assert "94 / 100" in beside and "100 / 100" in beside
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
            _shoot(page, f"{theme}-{width}")


def _shoot(page, look: str) -> None:
    if folder := os.environ.get("SCREENSHOTS"):
        page.screenshot(path=f"{folder}/report-{look}.png", full_page=True)
        for name in ("reports", "reports/new"):
            page.goto(f"/{name}/")
            page.screenshot(path=f"{folder}/{name.replace('/', '-')}-{look}.png", full_page=True)
