"""The command against a running site, with a worker that drives: from a token to a proof."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import zipfile
from datetime import timedelta

import pytest
from django.core.management import call_command
from django.utils import timezone

from evaluation.garage import admission
from evaluation.models import Evaluation, Result, RivalResult, TrainedModel
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.queue.worker import run_next_evaluation
from evaluation.sandbox import launch as sandbox
from paddock.cli import rehearsing
from paddock.rules.race import RaceRules
from paddock.simulator import engine
from races.entries.services.entries import enter_race
from races.live.services import (
    begin_live,
    choose_model,
    command_now,
    launch,
    plan_live,
    prepare_ahead,
    tick_live,
)
from races.live.streaming.pose_chunks import CHUNK_MS, chunks_of
from tests.factories import a_racer, a_track
from tests.shared import CHECKOUT
from training.golden.cars import HOUSE_CARS

pytestmark = [pytest.mark.slow, pytest.mark.django_db(transaction=True), pytest.mark.usefixtures("site")]
CAR, OTHER = ((HOUSE_CARS / f"{name}.onnx", HOUSE_CARS / f"{name}.json") for name in ("flyer", "brisk"))


def the_run() -> Evaluation:
    return Evaluation.objects.select_related("result").get()


def test_from_a_token_to_a_proof(paddock, log_in, race, site, monkeypatch, tmp_path):
    monkeypatch.setattr(admission, "launch", sandbox.launch)  # behind the walls, as on a real site
    log_in("alice")
    assert paddock("races").out.split("\n")[1].startswith("open")
    assert paddock("tracks", "--search", "oval", "--json").json[0]["slug"] == "oval"
    assert paddock("board", "open").out == "Nobody yet.\n"

    sent = paddock("submit", *CAR, f"{site}/races/open/", "--wait", "--json")
    assert sent.status == 0
    run = the_run()
    assert sent.json["evaluation"] == run.public_id and sent.json["entry"]["rank"] == 1
    assert sent.json["run"]["result"]["trace_sha256"] == run.result.trace_sha256
    assert "alice" in paddock("board", "open").out

    at_home = paddock("evaluate", *CAR, "--race", "open", "--json", "--trace", tmp_path / "run.csv")
    assert at_home.status == 0
    assert at_home.json["trace_sha256"] == run.result.trace_sha256
    assert at_home.json["same_as_the_site"] is True
    assert b"lap_complete" in (tmp_path / "run.csv").read_bytes()

    proof = paddock("verify", f"{site}/evaluations/{run.public_id}/", "--json")
    assert (proof.status, proof.json["proof"], proof.json["same"]) == (0, "network", True)

    again = paddock("submit", *CAR, "open", "--wait")
    assert again.status == 0 and "sent to this race before" in again.err
    assert Evaluation.objects.count() == 1


def test_a_stranger_proves_a_result_without_the_network(paddock, log_in, race, site):
    log_in("alice")
    assert paddock("submit", *CAR, "open", "--wait").status == 0
    log_in("bob")
    run = the_run()
    proof = paddock("verify", run.public_id)
    assert proof.status == 0
    assert "Proven without the networks" in proof.out and "alice is not open to you" in proof.out

    laps = [{**lap, "time_ms": lap["time_ms"] - 100} for lap in run.result.laps]
    Result.objects.update(laps=laps)
    forged = paddock("verify", run.public_id)
    assert forged.status == 1 and "DIFFERENT  car 0, commands driven again: laps and sectors" in forged.out
    assert "NOT proven" in forged.out

    Result.objects.update(laps=run.result.laps, trace_sha256="0" * 64)
    assert paddock("verify", run.public_id, "--json").json["same"] is False

    Result.objects.update(engine="paddock-v2")
    other = paddock("verify", run.public_id)
    assert (other.status, other.code) == (3, "engine_differs") and "paddock-v2" in other.err


def test_a_shared_network_is_fetched_and_driven(paddock, log_in, race):
    log_in("alice")
    assert paddock("submit", *CAR, "open", "--wait").status == 0
    TrainedModel.objects.update(shared_at=timezone.now())
    log_in("bob")
    proof = paddock("verify", the_run().public_id)
    assert proof.status == 0 and "the networks were driven again" in proof.out


def test_several_cars_are_proven_together(paddock, log_in, site):
    alice = log_in("alice")
    ids = [paddock("upload", *files, "--json").json["public_id"] for files in (CAR, OTHER)]
    flyer, brisk = (TrainedModel.objects.get(public_id=one) for one in ids)
    rules = RaceRules(race_type="head_to_head", laps=1, max_simulated_ms=3000)
    run = queue_evaluation(owner=alice, model=flyer, rivals=[brisk], track=a_track(), rules=rules, now=timezone.now())
    assert run_next_evaluation(worker="w")
    proof = paddock("verify", run.public_id, "--json")
    assert (proof.status, proof.json["proof"], proof.json["proven"]) == (0, "network", True)
    assert {"car 1, network driven again: trace", "order of the cars"} <= {one["what"] for one in proof.json["checks"]}
    blind = paddock("verify", run.public_id, "--trace-only", "--json")
    assert (blind.status, blind.json["proof"], blind.json["proven"]) == (0, "trace", True)

    RivalResult.objects.update(end_reason="retired", retired_code="non_finite_action", retired_params={"step": 3})
    unproven = paddock("verify", run.public_id, "--trace-only")
    assert unproven.status == 3 and "Not proven, but for the files" in unproven.out


def test_a_live_run_with_a_speed_command_is_proven(paddock, log_in, race, capsys):
    """Shown live, commanded while it was played, revealed: driven by the real engine from the first step on."""
    alice, bob, now = a_racer("alice"), log_in("bob"), timezone.now()
    type(race).objects.update(organiser=alice, ranking_method="best", minimum_laps=1)
    race.refresh_from_db()
    model = TrainedModel.objects.get(public_id=paddock("upload", *CAR, "--json").json["public_id"])
    enter_race(race=race, racer=bob, now=now)
    starts = now + timedelta(minutes=5)
    event = plan_live(race=race, by=alice, now=now, starts_at=starts, rounds=1, attempt_ms=10_000, speed_control=True)
    choose_model(event=event, racer=bob, model=model, now=now)
    begin_live(event=event, by=alice, seen=None, now=now)
    prepare_ahead(event=event, now=now)
    assert run_next_evaluation(worker="w")
    slot = launch(event=event, by=alice, seen=None, now=now)
    old = chunks_of(Result.with_sealed.get(evaluation=slot.evaluation_id))
    command_now(event=event, racer=slot.racer, by=bob, mode="multiplier", value=0.5, now=slot.starts_at)
    assert run_next_evaluation(worker="w")
    tick_live(now=slot.starts_at + timedelta(seconds=1))
    slot.refresh_from_db()
    new = chunks_of(Result.with_sealed.get(evaluation=slot.evaluation_id))
    (effect,) = (one["at_ms"] // CHUNK_MS for one in slot.speed_log)
    assert effect == 8, "3 s and a twentieth of 10 s, on the next whole second"
    assert new[:effect] == old[:effect], "to the bit"
    assert new[effect:] != old[effect:]
    assert max(new[-1]["cars"][0]["v"]) < max(old[-1]["cars"][0]["v"])
    for second in range(2, (slot.ends_at - slot.starts_at) // timedelta(seconds=1) + 3):
        tick_live(now=slot.starts_at + timedelta(seconds=second))

    run = the_run()
    for how, proof in (((), "network"), (("--trace-only",), "trace")):
        told = paddock("verify", run.public_id, "--json", *how)
        assert told.status == 0, (told.out, told.err)
        assert (told.json["proof"], told.json["proven"]) == (proof, True)
    call_command("verify", run.public_id)
    assert "is the same" in capsys.readouterr().out


def test_another_engine_of_the_site_is_said(paddock, log_in, race, monkeypatch):
    log_in("alice")
    assert rehearsing.ENGINE_ID == engine.ENGINE_ID  # the command holds its own
    monkeypatch.setattr(engine, "ENGINE_ID", "paddock-v99")  # the site's
    said = paddock("evaluate", *CAR, "--race", "open", "--json")
    assert said.status == 0
    assert said.json["same_as_the_site"] is None and said.json["site"]["engine"] == "paddock-v99"
    assert "paddock-v99" in paddock("evaluate", *CAR, "--race", "open").out


def test_what_the_site_refuses_is_told_in_its_words(paddock, log_in, race, tmp_path):
    log_in("alice", ("read",))
    refused = paddock("upload", *CAR)
    assert (refused.status, refused.code) == (2, "scope_missing")
    log_in("bob")
    (tmp_path / "car.zip").write_bytes(b"no zip at all")
    assert paddock("upload", tmp_path / "car.zip").status == 2
    race.max_submissions = 1
    race.save()
    assert paddock("submit", *CAR, "open").status == 0
    refused = paddock("submit", *OTHER, "open", "--json").json["error"]["code"]
    assert refused in ("submissions_used_up", "submission_running")
    assert paddock("submit", *OTHER, "closed").code == "not_on_site"
    assert paddock("evaluate", *CAR, "--race", "closed").code == "not_on_site"


def test_a_model_comes_back_as_it_was_uploaded(paddock, log_in, tmp_path):
    log_in("alice")
    model = paddock("upload", *CAR, "--name", "Bolt", "--json").json
    assert model["name"] == "Bolt"
    target = tmp_path / "bolt.zip"
    assert paddock("download", model["public_id"], target).status == 0
    assert sorted(zipfile.ZipFile(target).namelist()) == ["model.onnx", "model_metadata.json"]
    assert paddock("download", model["public_id"], target).code == "home_exists"
    assert paddock("upload", target, "--json").json["public_id"] == model["public_id"]


def test_an_export_at_home_is_the_sites(paddock, log_in, tmp_path):
    log_in("alice")
    model = paddock("upload", *CAR, "--json").json
    at_home, from_the_site = tmp_path / "model.tar.gz", tmp_path / "site.tar.gz"
    assert paddock("export", *CAR, "--to", at_home).status == 0
    assert paddock("export", model["public_id"], "--to", from_the_site).status == 0
    assert at_home.read_bytes() == from_the_site.read_bytes()
    assert paddock("export", *CAR, "--to", at_home).code == "home_exists"
    assert paddock("upload", at_home, "--json").json["public_id"] == model["public_id"]
    assert paddock("export", *CAR, "--form", "openvino", "--to", tmp_path / "ir.tar.gz").status == 0
    assert paddock("export", "nothing.onnx", "--to", tmp_path / "no").code == "home_file_unreadable"


def test_a_token_can_be_given_back(paddock, log_in):
    log_in("alice")
    assert paddock("logout", "--revoke").status == 0
    assert paddock("upload", *CAR).code == "token_missing"


def test_a_wrong_token_is_not_kept(paddock, site, monkeypatch, config):
    monkeypatch.setattr(sys, "stdin", io.StringIO("nonsense\n"))
    assert paddock("login", site).code == "token_refused"
    assert not (config / "sites.json").exists()


def test_the_command_is_a_program(site, race):
    done = subprocess.run(
        [sys.executable, "-m", "paddock.cli", "races", "--json"],
        capture_output=True,
        text=True,
        check=True,
        cwd=CHECKOUT,
        env={**os.environ, "PADDOCK_SITE": site},
    )
    assert [found["slug"] for found in json.loads(done.stdout)] == ["open"]
