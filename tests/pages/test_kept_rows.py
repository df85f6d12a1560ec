"""Rows and fields that are kept by their values: each racer sees their own, in their language, as they are now."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from functools import reduce
from types import SimpleNamespace

import pytest
from django.conf import settings
from django.db import connection
from django.template import Context
from django.test import Client
from django.utils import timezone, translation

from accounts.models import Racer
from core.streams import shared_pieces
from evaluation.models import TrainedModel
from races.models import Race
from races.replays.run_maps import LapRow
from races.replays.views import lap_of_run
from races.spoilers.selectors import Spoilers
from races.templatetags.races import offer_row, run_row
from races.test_runs.services import drive_own
from tests.factories import a_model, a_race, a_racer, drive, laps
from tests.training.jobs import a_training
from training.models import Vehicle
from training.wizard import fields

pytestmark = pytest.mark.django_db(transaction=True)


def a_world(alias: str, race: Race) -> tuple[Racer, TrainedModel, list[str]]:
    """A racer with a car, a run, a test drive, a vehicle and a training; and texts of theirs by page."""
    now, racer = timezone.now(), a_racer(alias)
    model = a_model(racer, name=f"spare-of-{alias}")
    sent = drive(race, racer, laps(7_000, 7_001, 7_002), now)
    TrainedModel.objects.filter(pk=sent.evaluation.model_id).update(name=f"raced-of-{alias}")
    drive_own(owner=racer, model=model, track=race.track, now=now)
    Vehicle.objects.create(owner=racer, name=f"wheels-of-{alias}")
    a_training(racer, race.track, now, name=f"training-of-{alias}")
    sent_page = f"/models/{sent.evaluation.model.public_id}/"
    return racer, model, ["/train/new/", "/models/", "/runs/", f"/models/{model.public_id}/", sent_page, "/"]


@pytest.fixture
def race() -> Race:
    return a_race(timezone.now(), slug="kept", name="Kept race")


def of_racer(racer: Racer) -> Client:
    client = Client(enforce_csrf_checks=True)
    client.force_login(racer)
    return client


def read(client: Client, path: str, language: str = "en") -> str:
    client.cookies[settings.LANGUAGE_COOKIE_NAME] = language
    answer = client.get(path)
    assert answer.status_code == 200, path
    html = answer.content.decode()
    assert f'<html lang="{language}"' in html
    return html


@pytest.mark.parametrize("rounds", [4, pytest.param(60, marks=pytest.mark.slow)])
def test_racers_at_once_see_their_own_rows_only(race, rounds):
    worlds = {alias: a_world(alias, race) for alias in ("anna", "bert")}

    def look(alias: str) -> None:
        racer, _model, paths = worlds[alias]
        other = "bert" if alias == "anna" else "anna"
        client = of_racer(racer)
        try:
            for number in range(rounds):
                for path in paths:
                    html = read(client, path, ("en", "ko")[number % 2])
                    assert f"-of-{other}" not in html and shared_pieces._TOKEN not in html, path
                    if path != "/":
                        assert f"-of-{alias}" in html, path
        finally:
            connection.close()

    with ThreadPoolExecutor(2) as threads:
        list(threads.map(look, worlds))


def test_a_form_to_send_a_car_has_the_car_and_the_token_of_its_reader(race):
    other_race = a_race(timezone.now(), slug="other", name="Other race")
    for alias in ("anna", "bert"):
        racer, model, _paths = a_world(alias, race)
        client = of_racer(racer)
        html = read(client, f"/models/{model.public_id}/")
        forms = re.findall('<form method="post" action="/races/other/submit/">(.*?)</form>', html, re.DOTALL)
        assert len(forms) == 1
        sent = dict(re.findall(r'name="(\w+)" value="([^"]*)"', forms[0]))
        assert sent["model"] == model.public_id
        assert client.post("/races/other/submit/", sent).status_code == 302
        assert other_race.entries.filter(racer=racer).count() == 1


def test_rows_change_with_what_they_show(race):
    racer, model, _paths = a_world("anna", race)
    client = of_racer(racer)
    assert "spare-of-anna" in read(client, "/train/new/")
    assert "Kept race" in read(client, f"/models/{model.public_id}/")
    TrainedModel.objects.filter(pk=model.pk).update(name="renamed")
    Vehicle.objects.update(name="other-wheels")
    Race.objects.update(name="Renamed race")
    html = read(client, "/train/new/")
    assert "renamed" in html and "spare-of-anna" not in html
    assert "other-wheels" in html and "wheels-of-anna" not in html
    assert "Renamed race" in html
    html = read(client, f"/models/{model.public_id}/")
    assert "Renamed race" in html and "Kept race" not in html


def test_values_that_are_not_offered_are_one_piece(race, monkeypatch):
    """An address may name any: they do not push out what others read."""
    racer, _model, _paths = a_world("anna", race)
    client, wheels = of_racer(racer), Vehicle.objects.get()
    kept = shared_pieces._Lasting(400)
    monkeypatch.setattr(shared_pieces, "_lasting_pieces", kept)
    pieces = []
    for value in ("first", "second"):
        html = read(client, f"/train/new/?vehicle={value}&submit_to_race={value}")
        assert not re.search(r'<input[^>]* name="vehicle"[^>]* checked', html)
        pieces.append({*kept._values})
    assert pieces[0] == pieces[1]
    for vehicle in (wheels.public_id, ""):
        html = read(client, f"/train/new/?vehicle={vehicle}&submit_to_race=kept")
        assert re.search(rf'<input[^>]* name="vehicle" value="{vehicle}"[^>]* checked', html)
        assert re.search(r'<option value="kept"[^>]* selected', html)


def test_what_is_kept_of_models_is_what_its_key_says(race, monkeypatch):
    racer, _model, _paths = a_world("anna", race)
    asked = []
    monkeypatch.setattr(fields, "newest_shared", lambda *_: asked.append(1) or [])
    read(of_racer(racer), "/train/new/")
    assert asked == [1]


@pytest.fixture
def anew(monkeypatch):
    """Whether a piece that is kept is the one that is drawn anew, and another than the last one."""
    said = [""]

    def check(draw, what):
        kept = draw()
        with monkeypatch.context() as patched:
            patched.setattr(shared_pieces, "_lasting_pieces", shared_pieces._Lasting(9))
            assert draw() == kept != said[0], what
        said[0] = kept

    return check


def changed(anew, draw, row, changes):
    """Draw with one change after the other."""
    anew(draw, "unchanged")
    for path, value in changes:
        *way, name = path.split(".")
        setattr(reduce(getattr, way, row), name, value)
        anew(draw, path)


def test_a_row_of_a_run_changes_with_all_that_it_shows(race, anew):
    run = drive(race, a_racer("anna"), laps(7_000, 7_001, 7_002), timezone.now()).evaluation
    reader = Context({"request": None})
    hidden = Context({"request": SimpleNamespace(_spoilers=Spoilers(since=run.queued_at))})
    to_race = "submission.entry.race"
    changes = [("result.off_tracks", 5), ("result.complete_laps", 2), (f"{to_race}.name", "<b>Other</b>")]
    changes += [("result.laps", run.result.laps[:1]), ("queued_at", run.queued_at - timedelta(hours=2))]
    changes += [("state", "failed"), ("reason_code", "policy_late"), ("reason_params", {"step": 3, "seconds": 1})]
    changed(anew, lambda: run_row(reader, run), run, changes)
    for options in ({"compact": True}, {}):
        anew(lambda options=options: run_row(reader, run, **options), options)
    anew(lambda: run_row(hidden, run), "hidden")
    with timezone.override("Asia/Seoul"):
        anew(lambda: run_row(reader, run), "time zone")
    with translation.override("ko"):
        anew(lambda: run_row(reader, run), "language")


@pytest.mark.parametrize("where", ["training/parts/race_offer.html", "training/jobs/parts/race_offer.html"])
def test_a_race_that_takes_a_car_changes_with_all_that_is_said_of_it(where, race, anew):
    sent = drive(race, a_racer("anna"), laps(7_000, 7_001, 7_002), timezone.now())
    model, context = sent.evaluation.model, Context({"csrf_token": "t"})
    offer = SimpleNamespace(race=race, sent=None, fits=False)
    changes = [("race.name", "<b>Other</b>"), ("race.track.name", "Other track"), ("race.race_type", "head_to_head")]
    changes += [("race.slug", "other")]
    if "jobs" in where:  # the page of the model does not say which way
        changes += [("race.direction", "cw"), ("race.track.is_open", True), ("fits", True)]
    changes += [("sent", sent), ("sent.evaluation.state", "failed"), ("sent.evaluation.public_id", "another")]

    def draw():
        return offer_row(context, where, offer, model)

    changed(anew, draw, offer, changes)
    offer.sent = None
    anew(draw, "not sent")
    assert "&lt;b&gt;Other" in draw() and "<b>" not in draw()
    model.public_id = '"><b>'
    anew(draw, "the model")
    assert "<b>" not in draw()
    context["csrf_token"] = "u"
    anew(draw, "the token")


def test_a_lap_in_a_comparison_changes_with_all_that_it_shows(anew):
    lap = {"number": 2, "time_ms": 9_000, "complete": True, "completion_percentage": 100}
    row = LapRow(lap, is_best=False, gap_ms=None, sectors=[(3_000, "green")] * 3)
    of = SimpleNamespace(name="anna", look=SimpleNamespace(shell="paddock", colour="#112233"), lap=2)
    shown = SimpleNamespace(of=of, gap_ms=None)

    def draw():
        return lap_of_run(of, row, shown.gap_ms)

    changes = [("of.name", "<b>bert</b>"), ("of.look.colour", "#445566"), ("of.look.shell", "hatch"), ("of.lap", 1)]
    changed(anew, draw, shown, [*changes, ("gap_ms", 120), ("gap_ms", -120)])
    for change in ({"number": 3}, {"time_ms": 9_001}, {"complete": False}, {"completion_percentage": 50}):
        lap.update(change)
        anew(draw, change)
    for sectors in ([(3_000, "green")] * 2, [(3_001, "green")] * 2):
        row.sectors[:] = sectors
        anew(draw, sectors)
    with translation.override("ko"):
        anew(draw, "language")
