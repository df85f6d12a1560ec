"""A cruising car step in one call into C, to its next answer: the same drive as with Python between."""

from __future__ import annotations

import os
import threading
import zlib

import pytest

from evaluation.sandbox.observation_memory import map_for_reading
from evaluation.sandbox.policy_client import PolicyClient
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.network.policy_wire import EXACT, FAST, STEP
from paddock.rules.race import RaceRules
from paddock.simulator import cruise
from paddock.simulator.action import ActionSpace
from paddock.simulator.race import Entrant, RaceSettings, run_race

from .networks import CAMERA
from .test_exchange import PATIENT, Ends, reply

pytestmark = [
    pytest.mark.skipif(PolicyClient.library is None, reason="no compiled library"),
    pytest.mark.usefixtures("nothing_left"),
]
OVAL = next(entry for entry in CATALOGUE if entry.slug == "oval").geometry()
DISCRETE = ActionSpace.discrete([(-10.0, 1.5), (0.0, 1.5), (10.0, 1.0)])
CONTINUOUS = ActionSpace.continuous((-20.0, 20.0), (0.5, 3.0))


class PictureModel(threading.Thread):
    """A model that answers by the bytes that it sees, so that no two drives are the same that see one byte else."""

    def __init__(self, ends, count, last=None, said=b""):
        super().__init__()
        self.ends, self.count, self.last, self.said = ends, count, last, said
        self.seen = []

    def run(self):
        picture = map_for_reading(self.ends.shown.reading_fd)
        while request := self.ends.read():
            (step,) = STEP.unpack(request)
            self.seen.append(zlib.crc32(bytes(picture[:19200])))
            values = [((self.seen[-1] >> 8 * number) % 255 - 127) / 254 for number in range(self.count)]
            said = reply(step, values, EXACT if step % 3 else FAST)
            self.ends.answer(self.said if step == self.last else said)


class ModelEnds(Ends):
    """With the other ends as a model has them."""

    def read(self):
        return os.read(self.requests, STEP.size)

    def answer(self, said):
        os.write(self.answers, said)


def drive(space, ahead, last=None, said=b"", every=15, **rules):
    """All that a race, its client and its model tell; ``last``: the step at which the model says ``said`` instead."""
    told = []
    with ModelEnds(PolicyClient, PATIENT, outputs=space.size) as ends:
        client = ends.client
        driver = PictureModel(ends, space.size, last, said)
        driver.start()
        policy = client.choose if space is DISCRETE else client.ask
        car = Entrant(space, [CAMERA], policy, places=client.places, asked=client if ahead else None)
        settings = RaceSettings(
            OVAL,
            RaceRules(**rules),
            [car],
            on_progress=lambda now: told.append(now.to_dict()),
            progress_every_steps=every,
        )
        try:
            result = run_race(settings)
            outcome = result.trace.to_csv(), result.end_reason, result.steps, [lap.to_dict() for lap in result.laps]
            assert min(result.seconds["camera"], result.seconds["policy"]) > 0.0
        except UserFault as fault:
            outcome = fault.code, fault.params
        finally:
            ends.close_end(ends.write_fd)
            driver.join()
    return outcome, driver.seen, client.counts, client.step, told


@pytest.fixture
def strides(monkeypatch):
    """The outcomes of the calls that ask."""
    found = []

    class Counted(cruise.Cruise):
        def step(self, action):
            ahead = super().step(action)
            found.append(ahead is not None)
            return ahead

    monkeypatch.setattr("paddock.simulator.race.Cruise", Counted)
    return found


@pytest.mark.parametrize("space", [DISCRETE, CONTINUOUS], ids=["discrete", "continuous"])
@pytest.mark.parametrize(
    "rules", [{"laps": 1, "every": 7}, {"max_resets": 3, "off_track_penalty_ms": 400}, {"standing_laps": True}], ids=str
)
def test_the_drive_is_the_same(space, rules, strides):
    rules = {"max_simulated_ms": 20_000, **rules}
    asked_ahead = drive(space, True, **rules)
    assert sum(strides) > 0.3 * len(asked_ahead[1])
    strides.clear()
    assert drive(space, False, **rules) == asked_ahead
    assert strides and not any(strides)


@pytest.mark.parametrize("said", [reply(6), reply(7) + b"\0", reply(7, (0.0, float("nan"), 1.0)), reply(7, way=4)])
def test_the_fault_is_the_same(said, strides):
    outcome, seen, counts, step, _ = drive(DISCRETE, True, last=7, said=said)
    assert outcome[0] in ("policy_protocol", "non_finite_action") and outcome[1] == {"step": 7}
    assert any(strides)
    assert drive(DISCRETE, False, last=7, said=said)[:4] == (outcome, seen, counts, step)


def test_places_that_no_picture_fits_are_filled_by_python(strides):
    with ModelEnds(PolicyClient, PATIENT) as ends:
        car = Entrant(DISCRETE, [CAMERA, "LIDAR"], lambda _: 1, places=None, asked=ends.client)
        assert run_race(RaceSettings(OVAL, RaceRules(max_simulated_ms=3000), [car])).steps > 10
        assert not ends.client.step
    assert strides and not any(strides)
