"""No byte of the future of a bracket: while one sealed heat is played and the next waits, every address of the site is
fetched, and neither who wins nor anything of their runs is in any answer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import timedelta

import pytest
from django.utils import timezone

from core.events import Event
from evaluation.models import Evaluation, Result
from evaluation.running.queue.jobs import finish_evaluation
from races.entries.services.entries import enter_race
from races.live.services import begin_live, launch, plan_live, prepare_ahead, tick_live
from races.models import Duel, DuelCompetitor, LiveSlot, Race
from tests.duels import duel_outcome
from tests.factories import a_model, a_racer, drive, laps, start
from tests.pages.conftest import make_world
from tests.pages.test_live_walls import VIEWERS, Needles, Show, fetched, nothing_leaks, sought
from tests.soak import only

pytestmark = [pytest.mark.django_db, pytest.mark.slow]
LAP_MS = 13_457  # nobody else drives it


@dataclass
class HeatShow(Show):
    """The same for two heats."""

    def needles(self) -> Needles:
        times = {"lap": str(LAP_MS), "lap read": "0:13.457"[2:], "lap in s": f"{LAP_MS / 1000:.3f}"}
        found: dict[str, str] = {}
        for slot, name in ((self.playing, "playing"), (self.coming, "coming")):
            run = Evaluation.with_sealed.get(pk=slot.evaluation_id)
            result = Result.with_sealed.get(evaluation=run)
            rival = result.rivals.get()
            found |= {f"id of {name}": run.public_id, f"hash of {name}": result.trace_sha256}
            found |= {f"hash of the rival of {name}": rival.trace_sha256}
        assert self.playing.ends_at is not None
        found["end"] = self.playing.ends_at.isoformat()[:19]
        return sought(found, times)


@pytest.fixture
def show(monkeypatch: pytest.MonkeyPatch, wakes, video_wakes) -> HeatShow:
    world, at = make_world(), timezone.now()
    race = world.race
    Race.objects.filter(pk=race.pk).update(
        race_type="head_to_head",
        opponents="models",
        duel_format="bracket",
        laps=3,
        minimum_laps=1,
        closes_at=at + timedelta(minutes=5),
    )
    race.refresh_from_db()
    racers = [world.bob, *(a_racer(name) for name in ("carl", "dora", "emma"))]
    for number, racer in enumerate(racers):
        enter_race(race=race, racer=racer, now=at)
        drive(race, racer, laps(*[9_000 + 10 * number] * 3), at)
        a_model(racer)
    event = plan_live(race=race, by=world.alice, now=at, starts_at=at + timedelta(minutes=10))
    now = at + timedelta(minutes=20)
    monkeypatch.setattr(timezone, "now", lambda: now)
    begin_live(event=event, by=world.alice, seen=None, now=now - timedelta(seconds=30))
    prepare_ahead(event=event, now=now - timedelta(seconds=30))
    playing, coming = list(LiveSlot.objects.filter(event=event).order_by("position"))[:2]
    for salt, slot in enumerate((playing, coming), 1):
        run = start(Evaluation.with_sealed.get(pk=slot.evaluation_id), now)
        outcome = duel_outcome([1, 0], {0: [LAP_MS] * 3, 1: [LAP_MS] * 3}, ())
        (rival,) = outcome.rivals
        rival = replace(rival, trace_sha256=f"{salt:02d}cd" * 16)
        outcome = replace(outcome, trace_sha256=f"{salt:02d}ab" * 16, rivals=(rival,))
        assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=outcome, now=now)
    launch(event=event, by=world.alice, seen=None, now=now - timedelta(seconds=16), slot=playing)
    playing.refresh_from_db()
    viewers = {
        "guest": None,
        "stranger": world.newcomer,
        "member": racers[2],
        "racer": world.bob,
        "organiser": world.alice,
        "staff": world.admin,
    }
    return HeatShow(world, event, playing, coming, viewers)


@pytest.mark.slow
@pytest.mark.parametrize("viewer", only(("racer",), VIEWERS))
def test_nothing_of_a_heat_that_is_to_come_leaves_the_server(show: HeatShow, viewer: str):
    nothing_leaks(show, viewer)
    assert not Duel.objects.exclude(state="waiting", evaluation=None, tries=0).exists()
    assert not DuelCompetitor.objects.filter(place__isnull=False).exists()
    assert not Event.objects.filter(kind="duel.decided").exists()


def test_what_is_sought_is_found_once_it_was_played(show: HeatShow):
    needles = show.needles()
    assert show.playing.ends_at is not None
    tick_live(now=show.playing.ends_at + timedelta(seconds=3))
    found = set()
    for _address, status, content in fetched(show, "guest"):
        if status == 200:
            found |= {what for what, needle in needles.items() if needle.search(content)}
    assert {"id of playing", "hash of playing", "hash of the rival of playing", "lap read"} <= found
    assert not {"id of coming", "hash of coming", "hash of the rival of coming"} & found
