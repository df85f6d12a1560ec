"""Medals of laps in races, and what is missing for the next one."""

from collections.abc import Sequence
from dataclasses import dataclass

from evaluation.models import Evaluation
from paddock.simulator.engine import ENGINE_ID
from tracks.reference.medals import Medal, medal_of, next_medal
from tracks.reference.selectors import Times, reference_ms

from ..models import Entry, Race, RaceType
from ..models.rules import usual


def race_reference_ms(race: Race, times: Times | None = None) -> int | None:
    """The reference lap in ms whose medals a race gives: simulated time trials with at least the usual penalty."""
    if race.physical or race.imported_at is not None or not _compares(race.race_type, race.off_track_penalty_ms):
        return None
    return reference_ms(race.track_id, race.direction, race.engine or ENGINE_ID, times)


def medal_in(race: Race, best_lap_ms: int | None, times: Times | None = None) -> Medal | None:
    """The medal of a best lap in a race. ``times``, here and below: of all references, for many laps."""
    return None if best_lap_ms is None else medal_of(best_lap_ms, race_reference_ms(race, times))


def medal_of_run(run: Evaluation, times: Times | None = None) -> Medal | None:
    """The medal of a finished run's best lap, by the same conditions."""
    rules = run.spec["rules"]
    if not _compares(rules["race_type"], rules["off_track_penalty_ms"]):
        return None
    return medal_of(run.result.best_lap_ms, reference_ms(run.track_id, rules["direction"], run.result.engine, times))


def _compares(race_type: str, off_track_penalty_ms: int) -> bool:
    least: int = usual("off_track_penalty_ms")
    return race_type == RaceType.TIME_TRIAL and off_track_penalty_ms >= least


@dataclass(frozen=True)
class MedalTarget:
    """The next medal in a race: its slowest lap; ``house``: the house car to beat, the fastest that is slower than the
    medal, and ``by_ms`` by how much its best lap must be beaten."""

    medal: Medal
    slowest_ms: int
    house: Entry | None
    by_ms: int | None


def medal_target(
    race: Race, best_lap_ms: int | None, house: Sequence[Entry] = (), times: Times | None = None
) -> MedalTarget | None:
    """The next medal for a best lap (None: no lap yet), with the help of ``house`` cars' entries. None where a race
    gives no medals, and for the best medal."""
    reference = race_reference_ms(race, times)
    coming = None if reference is None else next_medal(best_lap_ms, reference)
    if coming is None:
        return None
    medal, slowest = coming
    slower = [entry for entry in house if entry.best_lap_ms is not None and entry.best_lap_ms > slowest]
    rival = min(slower, key=lambda entry: entry.best_lap_ms or 0, default=None)
    by_ms = None if rival is None or rival.best_lap_ms is None else rival.best_lap_ms - slowest
    return MedalTarget(medal, slowest, rival, by_ms)
