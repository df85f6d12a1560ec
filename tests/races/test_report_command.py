"""``manage.py report``: the same report as the site's, without it."""

from __future__ import annotations

import io
import json

import pytest
from django.core.management import call_command
from django.utils import timezone

from core.management.base import Refusal
from evaluation.reports import planning
from evaluation.reports.jobs import run_next_chunk
from races.management.commands import report as command
from tests.evaluation.reports import a_report
from tests.evaluation.test_reports_driven import flyer_of
from tests.shared import CHECKOUT
from tests.wakeups import heard

CAR = [str(CHECKOUT / "training" / "house_cars" / name) for name in ("flyer.onnx", "flyer.json")]


def told(*options: str) -> dict:
    out = io.StringIO()
    call_command("report", *CAR, "--json", *options, stdout=out)
    return json.loads(out.getvalue())


def few(monkeypatch) -> None:
    """Six variations in place of a hundred, from mild to strong."""
    whole = command.variations
    monkeypatch.setattr(command, "variations", lambda seed, length: whole(seed, length)[:6])
    monkeypatch.setattr(planning, "VARIATIONS", 6)


@pytest.mark.slow
@pytest.mark.django_db
def test_it_comes_to_the_hash_of_the_site(alice, oval, wakes, monkeypatch):
    heard(monkeypatch, "evaluation.tasks.drive_reports")
    few(monkeypatch)
    here = a_report(alice, timezone.now(), model=flyer_of(alice), seed=7, direction="cw")
    while run_next_chunk(worker="w"):
        pass
    here.refresh_from_db()
    at_home = told("--tracks", "oval", "--direction", "cw", "--seed", "7")
    assert at_home["runs_sha256"] == here.runs_sha256 and len(at_home["laps"]) == 8
    assert at_home["robustness"]["grade"] == here.grade


@pytest.mark.django_db
@pytest.mark.parametrize(
    ("options", "code"),
    [
        (("--tracks", "none", "--variations-on", "none"), "report_empty"),
        (("--seed", "-1"), "report_seed"),
        (("--variations-on", "straight-track"), "report_no_way_round"),
        (("--tracks", "nowhere"), "track_not_found"),
    ],
)
def test_what_cannot_be_is_refused(options, code):
    out = io.StringIO()
    with pytest.raises((SystemExit, Refusal)) as refused:
        call_command("report", *CAR, "--json", *options, stdout=out, stderr=io.StringIO())
    assert getattr(refused.value, "code", None) == 2 or getattr(refused.value, "returncode", None) == 2
    assert json.loads(out.getvalue())["error"]["code"] == code
