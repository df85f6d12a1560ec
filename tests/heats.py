"""Heats of duels that the simulator really drives, for live events of tests."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from functools import cache

from evaluation.appearance.looks import Shell
from evaluation.models import Evaluation
from evaluation.running.pipeline import EvaluationOutcome
from evaluation.running.queue.jobs import finish_evaluation
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import MAX_CARS, RaceRules
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.results import CompetitorRun, RaceResult
from races.live.services import begin_live, launch, plan_live, prepare_ahead
from races.models import LiveEvent, LiveSlot
from tests.duels import a_duel_race, duel_outcome, qualify
from tests.factories import a_racer, a_track, start
from tests.live_shows import slots

SPEEDS = (1.9, 2.1, 2.0, 2.2)  # m/s: those behind overtake


@cache
def driven(track: TrackGeometry, laps: int = 3) -> RaceResult:
    """The most cars that a run has, each at a pace of its own, beside the centre line."""
    pilots = [CentreLinePilot(track, speed=speed, offset=(-1) ** at * 0.18) for at, speed in enumerate(SPEEDS)]
    entrants = [Entrant(pilot.action_space, pilot.sensors, pilot) for pilot in pilots]
    return run_race(RaceSettings(track, RaceRules(race_type="head_to_head", laps=laps), entrants))


def heat_outcome(result: RaceResult) -> EvaluationOutcome:
    """What the pipeline returns for a race."""

    def parts(run: CompetitorRun) -> dict:
        return {"laps": [lap.to_dict() for lap in run.laps], "trace_csv": run.trace.to_csv()}

    alone = duel_outcome(result.order, {}, ())
    rivals = [replace(car, **parts(run)) for car, run in zip(alone.rivals, result.rivals, strict=True)]
    return replace(alone, **parts(result), rivals=rivals, simulated_ms=result.simulated_ms)


def a_heat_on_track(now: datetime, since_s: float) -> tuple[LiveEvent, RaceResult]:
    """A live event of one duel of :data:`MAX_CARS` cars, which began to be played ``since_s`` ago."""
    alice, begins = a_racer("alice"), now - timedelta(hours=3)
    race = a_duel_race(begins, organiser=alice, slug="duel-night", name="Duel night", duel_cars=MAX_CARS)
    names = ("Ada", "Bob", "Carl", "Dora")
    qualify(race, [a_racer(name) for name in names], begins)
    event = plan_live(race=race, by=alice, now=begins, starts_at=race.closes_at + timedelta(minutes=30))
    begin_live(event=event, by=alice, seen=None, now=event.starts_at)
    prepare_ahead(event=event, now=event.starts_at)
    slot: LiveSlot = slots(event)[0]
    run = start(Evaluation.with_sealed.get(pk=slot.evaluation_id), now)
    for model, shell in zip([run.model, *(each.model for each in run.rivals.all())], Shell.values[1:], strict=False):
        model.shell = shell
        model.save()
    result = driven(a_track().geometry)
    assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=heat_outcome(result), now=now)
    launch(event=event, slot=slot, by=alice, seen=None, now=now - timedelta(seconds=10 + since_s))
    return event, result
