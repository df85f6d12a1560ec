"""What a host offers is found out by building it, and too little means that nothing runs."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
import time

import pytest

from evaluation.sandbox import bubblewrap, claims, cores, landlock, probe, seccomp, uids
from evaluation.sandbox.launch import launch
from evaluation.sandbox.limits import PROBE
from evaluation.sandbox.start import LEVEL_LOCK, LEVEL_NAMESPACES, LEVEL_NONE, LEVEL_PARTIAL
from paddock.errors import PlatformFault, UserFault
from tests.shared import CHECKOUT

from .conftest import PAYLOADS

fresh = probe.probe.__wrapped__


def names(report):
    return {layer.name: layer.available for layer in report.layers}


def test_the_report_is_plain_data_and_a_table():
    report = probe.probe()
    data = json.loads(json.dumps(report.to_dict()))
    assert data["level"] == report.level
    assert data["sufficient"] is report.sufficient
    assert [layer["name"] for layer in data["layers"]] == list(names(report))
    for layer in report.layers:
        assert layer.name in report.table()
        assert layer.detail


def test_probing_takes_under_a_second_and_happens_once():
    started = time.process_time()
    fresh()
    assert time.process_time() - started < 1
    assert probe.probe() is probe.probe()


def test_without_landlock_nothing_runs(monkeypatch):
    monkeypatch.setattr(landlock, "abi", lambda: 0)
    report = fresh()
    assert report.level == LEVEL_PARTIAL
    assert not report.sufficient
    assert not names(report)["lock"]


def test_without_libseccomp_nothing_runs(monkeypatch):
    def missing():
        raise RuntimeError("Unable to find libseccomp")

    monkeypatch.setattr(seccomp, "build", missing)
    report = fresh()
    assert not report.sufficient
    assert "libseccomp2" in report.table()


def test_without_landlock_and_libseccomp_the_level_is_none(monkeypatch):
    monkeypatch.setattr(landlock, "abi", lambda: 0)
    monkeypatch.setattr(seccomp, "build", lambda: (_ for _ in ()).throw(OSError("no")))
    assert fresh().level == LEVEL_NONE


def test_without_bubblewrap_the_lock_is_sufficient(monkeypatch):
    if probe.probe().level < LEVEL_LOCK:
        pytest.skip("this host offers no sandbox")
    monkeypatch.setattr(bubblewrap, "find", lambda: None)
    report = fresh()
    assert report.level == LEVEL_LOCK
    assert report.sufficient
    assert "apt-get install bubblewrap" in report.table()


def test_a_bubblewrap_without_namespaces_is_detected(monkeypatch, tmp_path):
    if probe.probe().level < LEVEL_LOCK:
        pytest.skip("this host offers no sandbox")
    refusing = tmp_path / "bwrap"
    refusing.write_text("#!/bin/sh\necho 'bwrap: No permissions to create new namespace' >&2\nexit 1\n")
    refusing.chmod(0o755)
    monkeypatch.setattr(bubblewrap, "find", lambda: str(refusing))
    report = fresh()
    assert report.level == LEVEL_LOCK
    assert "No permissions to create new namespace" in report.table()


@pytest.mark.parametrize(("setting", "user", "hint"), [("1\n", 1000, True), ("0\n", 1000, False), ("1\n", 0, False)])
def test_a_restriction_of_apparmor_is_named(setting, user, hint, monkeypatch, tmp_path):
    (tmp_path / "setting").write_text(setting)
    monkeypatch.setattr(probe, "_CONFINING", str(tmp_path / "setting"))
    monkeypatch.setattr(bubblewrap, "is_filtered", lambda: False)
    monkeypatch.setattr(os, "geteuid", lambda: user)
    assert probe._hint() == (probe.CONFINED if hint else "")
    assert "**On Ubuntu**" in (CHECKOUT / "docs/operators.md").read_text() and "On Ubuntu" in probe.CONFINED


def test_a_leaking_filter_is_detected(monkeypatch):
    """The lock itself tries its doors: here the filter allows every call, so a socket opens."""
    if probe.probe().level < LEVEL_LOCK:
        pytest.skip("this host offers no sandbox")
    allow_everything = bytes.fromhex("060000000000ff7f")  # BPF_RET, SECCOMP_RET_ALLOW
    monkeypatch.setattr(seccomp, "build", lambda: allow_everything)
    report = fresh()
    assert not report.sufficient
    assert "left a door open" in report.table()


def test_requiring_more_than_the_host_offers_stops_everything(monkeypatch):
    monkeypatch.setenv("PADDOCK_SANDBOX_LEVEL", "3")
    monkeypatch.setattr(bubblewrap, "find", lambda: None)
    report = fresh()
    assert report.minimum == LEVEL_NAMESPACES
    assert not report.sufficient
    monkeypatch.setattr(probe, "probe", lambda: report)
    with pytest.raises(PlatformFault) as caught:
        launch("resources", limits=PROBE, python_path=[PAYLOADS])
    assert caught.value.code == "sandbox_unavailable"


@pytest.mark.parametrize("text", ["0", "1", "4", "none", "-1", "2.5"])
def test_less_than_the_minimum_cannot_be_configured(monkeypatch, text):
    monkeypatch.setenv("PADDOCK_SANDBOX_LEVEL", text)
    with pytest.raises(ValueError, match="PADDOCK_SANDBOX_LEVEL"):
        probe.minimum_level()


@pytest.mark.parametrize("text", ["70000", "a-b", "5-1", "0-100", "500-70000", "70000-"])
def test_an_invalid_range_of_user_ids_is_refused(monkeypatch, text):
    monkeypatch.setenv("PADDOCK_SANDBOX_UIDS", text)
    with pytest.raises(ValueError, match="PADDOCK_SANDBOX_UIDS"):
        uids.configured_range()


def test_a_user_id_is_not_reused_before_it_is_returned(monkeypatch):
    monkeypatch.setenv("PADDOCK_SANDBOX_UIDS", "78000-78002")
    held = [uids.claim() for _ in range(3)]
    assert sorted(one.uid for one in held) == [78000, 78001, 78002]
    with pytest.raises(OSError, match="PADDOCK_SANDBOX_UIDS"):
        uids.claim()
    held[1].close()
    again = uids.claim()
    assert again.uid == held[1].uid
    for one in (held[0], held[2], again):
        one.close()


def test_two_processes_never_get_the_same_user_id(monkeypatch):
    monkeypatch.setenv("PADDOCK_SANDBOX_UIDS", "78010-78011")
    held = uids.claim()
    code = "from evaluation.sandbox import uids; print(uids.claim().uid)"
    done = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True, check=True)
    assert {held.uid, int(done.stdout)} == {78010, 78011}
    held.close()


def test_a_user_id_with_an_account_is_never_handed_out(monkeypatch):
    monkeypatch.setenv("PADDOCK_SANDBOX_UIDS", "65533-65534")
    with uids.claim() as held:
        assert held.uid == 65533  # 65534 is nobody


@pytest.mark.skipif(os.geteuid() != 0, reason="becoming an ordinary user takes root")
def test_an_ordinary_user_has_a_sandbox_too():
    """The interpreter may lie in root's private home: a mount of our own shows it to the user elsewhere."""
    libraries = os.pathsep.join([str(CHECKOUT), *bubblewrap.python_home().packages])
    executable = os.path.relpath(bubblewrap.python_home().executable, sys.base_prefix)
    code = (
        "import json, sys; from evaluation.sandbox.probe import probe; "
        "from evaluation.sandbox.policy import PolicyProcess; report = probe(); "
        "found = report.to_dict(); "
        "import tests.sandbox.networks as networks, numpy; "
        "levels = range(2, report.level + 1); answers = []\n"
        "for level in levels:\n"
        "    with PolicyProcess(level=level) as policy:\n"
        "        policy.load(networks.small_network(), networks.HEADER)\n"
        "        picture = {networks.CAMERA: numpy.full((120, 160, 1), 9, numpy.uint8)}\n"
        "        answers.append(policy.client(networks.HEADER)(picture).tolist())\n"
        "print(json.dumps([found, answers]))"
    )
    script = (
        f"mount --bind {sys.base_prefix} /mnt && cd / && exec setpriv --reuid=65533 --regid=65533 --clear-groups "
        f'env -i PATH=/usr/bin:/bin PYTHONPATH={libraries} LD_LIBRARY_PATH=/mnt/lib "/mnt/{executable}" -B -c "$0"'
    )
    done = subprocess.run(["unshare", "--mount", "sh", "-c", script, code], capture_output=True, text=True, timeout=60)
    if any(words in done.stderr for words in ("Permission denied", "not permitted", "No module named")):
        pytest.skip(f"an ordinary user cannot read this checkout or its packages: {done.stderr.strip()[-200:]}")
    assert done.returncode == 0, done.stderr
    report, answers = json.loads(done.stdout)
    assert report["sufficient"], report
    assert report["level"] == LEVEL_NAMESPACES or not bubblewrap.find()
    assert answers
    assert all(answer == answers[0] for answer in answers)


@pytest.mark.skipif(os.geteuid() != 0, reason="only a root launcher claims user ids")
def test_other_accounts_cannot_take_our_claim_names(monkeypatch):
    """They were abstract sockets, which any account of the machine may bind."""
    monkeypatch.setenv("PADDOCK_SANDBOX_UIDS", "70990-70991")
    with contextlib.ExitStack() as squatter:
        names = [f"uid-{uid}" for uid in (70990, 70991)] + [f"core-{core}" for core in os.sched_getaffinity(0)]
        for name in names:
            held = squatter.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
            held.bind(f"\0paddock-sandbox-{name}")
        with uids.claim() as first, uids.claim() as second:
            assert {first.uid, second.uid} == {70990, 70991}
            with pytest.raises(OSError, match="no free user id"):
                uids.claim()
        uids.claim().close()
        with cores.one_core([]) as core:
            assert core is not None


def test_claims_are_kept_in_a_private_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(claims, "_places", lambda: iter([tmp_path / "link", tmp_path / "file", tmp_path / "open"]))
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "file").write_text("")
    (tmp_path / "open").mkdir(mode=0o777)
    folder = claims.private_folder()
    assert (folder.name, folder.stat().st_mode & 0o777) == ("open", 0o700)
    with claims.claim("name") as held:
        assert held is not None and claims.claim("name") is None
    claims.claim("name").close()


def test_claims_before_the_first_start_leave_no_data_folder_open_to_others(tmp_path, monkeypatch):
    data = tmp_path / "site" / "data"
    monkeypatch.setenv("PADDOCK_DATA", str(data))
    folder = next(place for place in claims._places() if data in place.parents)
    monkeypatch.setattr(claims, "_places", lambda: iter([folder]))
    assert claims.private_folder() == folder
    assert {made.stat().st_mode & 0o777 for made in (data.parent, data, folder.parent, folder)} == {0o700}


@pytest.fixture
def two_cores(tmp_path, monkeypatch):
    """Claims of two cores that nobody else has."""
    monkeypatch.setattr(claims, "_places", lambda: iter([tmp_path / "claims"]))
    monkeypatch.setattr(cores.os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(cores.os, "sched_setaffinity", lambda *_: None)


def test_who_comes_when_all_cores_are_taken_waits_for_one(two_cores, monkeypatch):
    asked = []
    with contextlib.ExitStack() as first, cores.one_core([]) as second:
        assert {first.enter_context(cores.one_core([])), second} == {0, 1}
        with cores.one_core([]) as core:
            assert core is None, "without patience"

        def waiting():
            asked.append(time.monotonic())
            first.close()

        with cores.one_core([], 60.0, waiting) as core:
            assert core == 1 - second
        assert len(asked) == 1


def test_those_who_wait_for_a_core_stand_in_a_row(two_cores):
    with contextlib.ExitStack() as first:
        first.enter_context(claims.claim("next-core"))  # somebody waits already: the next core is theirs
        with cores.one_core([], 0.05) as core:
            assert core is None
        with cores.one_core([], 60.0, first.close) as core:
            assert core is not None
    with cores.one_core([], 60.0), cores.one_core([], 60.0) as core:
        assert core is not None, "who got one stands in the row no longer"


def test_a_name_is_tried_for_again_and_again(tmp_path):
    held = claims.claim("name", tmp_path)
    with claims.Candidate("name", tmp_path) as candidate:
        assert candidate.claim() is None
        assert candidate.claim() is None
        held.close()
        mine = candidate.claim()
        with pytest.raises(ValueError, match="claimed already"):
            candidate.claim()
    assert claims.claim("name", tmp_path) is None
    mine.close()
    claims.claim("name", tmp_path).close()
    with pytest.raises(ValueError, match="given up"), claims.Candidate("name", tmp_path) as candidate:
        candidate.close()
        candidate.claim()


def test_who_waits_for_a_core_in_vain_goes_on_without(two_cores):
    with cores.one_core([]), cores.one_core([]):
        began = time.monotonic()
        with cores.one_core([], 0.05) as core:
            assert core is None
        assert time.monotonic() - began >= 0.05


def test_a_run_that_is_stopped_while_it_waits_for_a_core_ends(two_cores):
    def stopped():
        raise UserFault("stopped")

    with cores.one_core([]), cores.one_core([]), pytest.raises(UserFault), cores.one_core([], 60.0, stopped):
        pass
    with cores.one_core([]) as core:
        assert core is not None


def test_a_missing_private_folder_is_reported(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(claims, "_places", lambda: iter([tmp_path / "file"]))
    with pytest.raises(OSError, match="private to this user"):
        claims.private_folder()
    with cores.one_core([], 60.0, lambda: pytest.fail("nothing comes of waiting")) as core:
        assert core is None, "only speed is lost"
