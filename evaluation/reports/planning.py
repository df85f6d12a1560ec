"""Which laps a report drives, and how they are dealt out to workers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.packages.inputs import SENSOR_NAMES
from paddock.rules.race import DIRECTIONS
from paddock.rules.report import VARIATIONS
from tracks.models import Track

from ..models import TrainedModel
from ..models.reports import TrackSet
from . import MOST_IN_CHUNK

LEAGUE = tuple(entry.slug for entry in CATALOGUE[:6])  # the catalogue lists the league's six first
MOST_TRACKS = 100
CHUNK_S = 10.0  # so long, about, a submission to a race waits for a worker that has just begun a chunk
_STEPS_A_METRE = 10.0  # at 1.5 m/s
_STEP_S, _MACS_A_S = 0.0005, 4e9  # simulator and pipes, and the network; on a slow core


@dataclass(frozen=True)
class PlannedLap:
    number: int
    track: Track
    direction: str
    variation: int | None


def tracks_of(track_set: str, chosen: Sequence[Track]) -> list[Track]:
    """The tracks of a set, in the order in which they are driven. Raises UserFault ``report_tracks`` for chosen tracks
    with a separate set, or none without; ``report_too_many_tracks``, ``report_track_without_shape``."""
    if (track_set == TrackSet.CHOSEN) != bool(chosen):
        raise UserFault("report_tracks")
    if track_set == TrackSet.CHOSEN:
        tracks = list(dict.fromkeys(chosen))
    elif track_set == TrackSet.NONE:
        tracks = []
    else:
        slugs = LEAGUE if track_set == TrackSet.LEAGUE else [entry.slug for entry in CATALOGUE]
        found = {track.slug: track for track in Track.objects.filter(slug__in=slugs, is_catalogue=True)}
        tracks = [found[slug] for slug in slugs if slug in found]
    if len(tracks) > MOST_TRACKS:
        raise UserFault("report_too_many_tracks", limit=MOST_TRACKS)
    for track in tracks:
        if not track.has_shape:
            raise UserFault("report_track_without_shape", track=track.name)
    return tracks


def check_sensors(model: TrainedModel) -> None:
    """Raises UserFault ``report_sensors`` for a model that reads what no track serves (any more)."""
    missing = [name for name in model.sensors if name not in SENSOR_NAMES]
    if missing:
        raise UserFault("report_sensors", sensors=", ".join(missing))


def check_variations(track: Track, direction: str, seed: int) -> None:
    """Raises UserFault ``report_track_without_shape``, ``report_no_way_round`` for a track that is not a loop,
    ``variation_not_placed``."""
    from paddock.simulator.camera.theme import THEMES
    from paddock.simulator.randomisation import check_placed, variations

    if not track.has_shape:
        raise UserFault("report_track_without_shape", track=track.name)
    if track.is_open:
        raise UserFault("report_no_way_round", track=track.name)
    geometry = track.geometry.in_direction(direction)
    for one in variations(seed, geometry.length):
        try:
            check_placed(geometry, one, THEMES[track.look])
        except UserFault as fault:
            raise UserFault(fault.code, **fault.params | {"track": track.name}) from None


def plan(tracks: Sequence[Track], variations_on: Track | None, direction: str) -> list[PlannedLap]:
    """Each track in both directions, the file's own first; then the variations."""
    laps: list[PlannedLap] = []
    for track in tracks:
        for way in sorted(DIRECTIONS, key=lambda way: way != track.direction):
            laps.append(PlannedLap(len(laps), track, way, None))
    if variations_on is not None:
        first = len(laps)
        laps += [PlannedLap(first + one, variations_on, direction, one) for one in range(VARIATIONS)]
    return laps


def chunks_of(laps: Sequence[PlannedLap], macs: int) -> Iterator[list[PlannedLap]]:
    """The laps in their order, as many at once as one worker drives in some seconds; ``macs``: the network's
    multiplications a step. The cut changes no result."""
    chunk: list[PlannedLap] = []
    seconds = 0.0
    for lap in laps:
        takes = (lap.track.length_m or 0.0) * _STEPS_A_METRE * (_STEP_S + macs / _MACS_A_S)
        if chunk and (len(chunk) == MOST_IN_CHUNK or seconds + takes > CHUNK_S):
            yield chunk
            chunk, seconds = [], 0.0
        chunk.append(lap)
        seconds += takes
    if chunk:
        yield chunk
