"""The garage through the API."""

from __future__ import annotations

import pytest

from races.test_runs.services import drive_own
from tests.factories import a_model, a_track

pytestmark = pytest.mark.django_db


def test_models_are_searched_and_sorted_with_their_last_run(alice, now, as_racer):
    bolt, _arrow = a_model(alice, name="Bolt"), a_model(alice, name="Arrow")
    run = drive_own(owner=alice, model=bolt, track=a_track(), now=now).evaluation
    rows = as_racer(alice).get("/api/v1/models/?sort=name").data["results"]
    assert [(row["name"], row["algorithm"]) for row in rows] == [("Arrow", "PPO"), ("Bolt", "PPO")]
    assert rows[0]["last_run"] is None
    assert rows[1]["last_run"] == {
        "evaluation": run.public_id,
        "state": "queued",
        "track": "oval",
        "best_lap_ms": None,
        "ended_at": None,
    }
    assert [row["name"] for row in as_racer(alice).get("/api/v1/models/?search=olt").data["results"]] == ["Bolt"]
    assert set(as_racer(alice).get("/api/v1/models/?sort=nonsense").data["fields"]) == {"sort"}
