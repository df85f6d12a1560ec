"""What a run's page says to do next: its largest loss, a comparison, the next training."""

from __future__ import annotations

import pytest
from django.test import Client
from django.utils import timezone

from evaluation.models import Evaluation, Result
from paddock.errors import PlatformFault
from races.telemetry import largest_loss as module
from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer

pytestmark = pytest.mark.django_db
SENTENCE = "0.82 s lost in turn 1: braked 0.4 m/s too much"


@pytest.fixture
def run(wakes) -> Evaluation:
    """Three laps, of which the second is the fastest and the third the slowest."""
    now = timezone.now()
    run = a_driven_run(a_race(now), a_racer("alice"), now, lap_ms=12_000)
    laps = run.result.laps
    laps[2]["time_ms"] += 400
    Result.objects.filter(evaluation=run).update(laps=laps)
    return Evaluation.objects.select_related("result", "track", "owner", "model").get(pk=run.pk)


def page(run: Evaluation) -> str:
    answer = Client().get(run.get_absolute_url())
    assert answer.status_code == 200
    return " ".join(answer.content.decode().split())


@pytest.fixture
def asked(monkeypatch) -> list:
    """The laps whose telemetry is asked for; the first of the losses is 8.3 s after the lap's start."""
    asked: list = []

    def document(laps):
        asked.extend(laps)
        return {"losses": [{"sentence": SENTENCE, "t_ms": 8_300}, {"sentence": "less", "t_ms": 0}]}

    monkeypatch.setattr(module, "telemetry_document", document)
    return asked


def test_the_largest_loss_of_the_slowest_lap_leads_to_its_moment(run, asked):
    html = page(run)
    assert [(lap.run, lap.number) for lap in asked] == [(run.public_id, 3)]
    assert SENTENCE in html and "less" not in html.partition(SENTENCE)[0].rpartition("What next")[2]
    assert f"/evaluations/{run.public_id}/replay/?lap=3&amp;t=8" in html
    assert "Largest loss, lap 3 against the best lap" in html


def test_a_run_with_one_complete_lap_has_no_loss(run, asked):
    laps = [lap | {"complete": lap["number"] == 2} for lap in run.result.laps]
    Result.objects.filter(evaluation=run).update(laps=laps)
    assert "Largest loss" not in page(run) and asked == []


def test_a_trace_that_is_gone_costs_the_page_nothing_but_the_loss(run, monkeypatch):
    def document(laps):
        raise PlatformFault("storage_failed")

    monkeypatch.setattr(module, "telemetry_document", document)
    html = page(run)
    assert "Largest loss" not in html and "What next" in html and "Compare with" in html


def test_files_and_proof_are_folded(run):
    html = page(run)
    folded = html.partition('<details class="card folded">')[2].partition("</details>")[0]
    for words in ("Files and proof", "sim-trace CSV", "Engine", "sha-256 of the trace"):
        assert words in folded and words not in html.replace(folded, "")
