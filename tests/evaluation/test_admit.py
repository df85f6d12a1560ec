"""What the site does when the process in the sandbox dies, dawdles or lies."""

from __future__ import annotations

import fcntl
import io
import json
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.garage import admission as admit_module
from evaluation.garage.admission import admit
from evaluation.sandbox.claims import default_directory
from evaluation.sandbox.launch import launch
from evaluation.sandbox.slots import upload_slot
from paddock import exact
from paddock.errors import PaddockError
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.read import UploadPart
from tests.hostile.parts import Upload, car, good_network, good_zip, metadata, pair, small_car
from tests.shared import CHECKOUT

PAYLOADS = Path(__file__).parent / "payloads"


def upload(files: Upload, **options: object):
    return admit([UploadPart(name, io.BytesIO(content)) for name, content in files], **options)


def upload_to(deed: str, monkeypatch: pytest.MonkeyPatch) -> PaddockError:
    """The fault that an upload ends with when the converter does this deed."""
    bad = {"arguments": [deed], "python_path": [PAYLOADS]}
    monkeypatch.setattr(admit_module, "launch", lambda module, **options: launch("bad_converter", **options | bad))
    with pytest.raises(PaddockError) as fault:
        upload(pair(good_network()))
    return fault.value


def test_a_network_is_read_in_small_pages_that_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def watched(module: str, **options: object):
        asked.append(options["memory"])
        return launch(module, **options)

    monkeypatch.setattr(admit_module, "launch", watched)
    upload(pair(good_network()))
    assert asked == [exact.KEPT_MEMORY] and exact.LARGE_PAGES not in exact.KEPT_MEMORY


@pytest.mark.parametrize(
    "deed",
    [
        "aborts",
        "returns_early",
        "garbage",
        "announces_too_much",
        "forges_a_platform_fault",
        "invents_a_code",
        "answers_without_a_network",
        "counts_in_words",
        "counts_less_than_nothing",
        "knows_no_bound",
        "stacks_no_frames",
        "stacks_too_many_frames",
    ],
)
def test_a_dying_or_lying_converter_gives_one_plain_reason(deed: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert upload_to(deed, monkeypatch).code == "conversion_crashed"


def test_a_converter_failing_before_its_lock_is_our_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    fault = upload_to("never_locks", monkeypatch)
    assert (fault.code, fault.fault) == ("conversion_failed", "platform")


def test_a_converter_out_of_memory_is_the_networks_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    assert upload_to("fills_memory", monkeypatch).code == "conversion_memory"


def test_a_converter_out_of_cpu_time_is_the_networks_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(admit_module, "CONVERTER", replace(admit_module.CONVERTER, cpu_s=1))
    assert upload_to("computes_for_ever", monkeypatch).code == "conversion_time"


def test_a_converter_starved_of_cpu_is_the_machines_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(admit_module, "CONVERTER", replace(admit_module.CONVERTER, cpu_s=30, wall_s=1.0))
    fault = upload_to("computes_for_ever", monkeypatch)
    assert (fault.code, fault.fault) == ("upload_busy", "platform")


def test_a_converters_text_is_shortened_and_cleaned(monkeypatch: pytest.MonkeyPatch) -> None:
    fault = upload_to("hides_codes_in_a_sentence", monkeypatch)
    assert fault.code == "onnx_attribute"
    assert str(fault).isprintable()
    assert len(str(fault)) < 500


def test_numbers_that_json_cannot_carry_are_not_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    fault = upload_to("counts_beyond_all_numbers", monkeypatch)
    assert fault.code == "onnx_output"
    json.dumps(fault.params, allow_nan=False)
    assert len(str(fault)) < 500


@pytest.mark.parametrize("files", [pair(good_network()), good_zip()], ids=["two files", "zip"])
def test_packaging_does_not_change_a_models_identity(files: Upload) -> None:
    admitted = upload(files)
    assert admitted.source_kind == "onnx"
    assert admitted.sha256 == upload(list(reversed(files))).sha256 == upload(pair(good_network())).sha256


def test_other_actions_make_another_model() -> None:
    first = upload(pair(good_network()))
    faster = metadata(action_space=[{"steering_angle": 0, "speed": 4}] * 5)
    second = upload(pair(good_network(), faster))
    assert first.onnx == second.onnx
    assert first.sha256 != second.sha256


def test_a_small_car_from_the_console_is_admitted() -> None:
    admitted = upload(car(small_car()))
    assert admitted.source_kind == "tensorflow"
    assert admitted.parameters > 0
    assert admitted.macs > 0


def test_a_slot_before_the_first_start_leaves_no_data_folder_open_to_others(tmp_path):
    locks = tmp_path / "data" / "locks"
    with upload_slot(1, 0.0, locks):
        assert {made.stat().st_mode & 0o777 for made in (locks.parent, locks)} == {0o700}


def test_an_upload_is_refused_while_all_slots_are_taken(tmp_path: Path) -> None:
    impatient = replace(DEFAULT_LIMITS, slots=1, slot_wait_s=0.0)
    with upload_slot(1, 0.0, tmp_path), pytest.raises(PaddockError) as fault:
        upload(pair(good_network()), limits=impatient, slots_directory=tmp_path)
    assert (fault.value.code, fault.value.fault) == ("upload_busy", "platform")
    assert upload(pair(good_network()), limits=impatient, slots_directory=tmp_path).parameters == 10


def test_the_limits_set_the_number_of_slots(tmp_path: Path) -> None:
    with upload_slot(2, 0.0, tmp_path), upload_slot(2, 0.0, tmp_path):
        with pytest.raises(PaddockError), upload_slot(2, 0.0, tmp_path):
            pass
        with upload_slot(3, 0.0, tmp_path):
            pass


def test_an_upload_is_turned_away_when_others_already_wait(tmp_path: Path) -> None:
    """Each that waits holds a thread of the web server."""
    started = time.monotonic()
    with upload_slot(1, 0.0, tmp_path), (tmp_path / "waiting-0").open("wb") as another_waits:
        fcntl.flock(another_waits, fcntl.LOCK_EX)
        with pytest.raises(PaddockError) as fault, upload_slot(1, 60.0, tmp_path, waiting=1):
            pass
    assert fault.value.code == "upload_busy"
    assert time.monotonic() - started < 30


def test_a_waiting_upload_gets_the_next_slot(tmp_path: Path) -> None:
    def take() -> bool:
        with upload_slot(1, 60.0, tmp_path, waiting=1):
            return True

    with ThreadPoolExecutor(1) as threads:
        with upload_slot(1, 0.0, tmp_path):
            other = threads.submit(take)
        assert other.result()


def test_one_racer_has_one_slot_at_a_time(tmp_path: Path) -> None:
    with upload_slot(2, 0.0, tmp_path, racer_pk=7):
        with pytest.raises(PaddockError), upload_slot(2, 0.0, tmp_path, racer_pk=7):
            pass
        with upload_slot(2, 0.0, tmp_path, racer_pk=8):
            pass
    with upload_slot(2, 0.0, tmp_path, racer_pk=7):
        pass


def test_a_refused_upload_gives_its_slot_back(tmp_path: Path) -> None:
    impatient = replace(DEFAULT_LIMITS, slots=1, slot_wait_s=0.0)
    for _ in range(3):
        with pytest.raises(PaddockError) as fault:
            upload([("x", b"")], limits=impatient, slots_directory=tmp_path)
        assert fault.value.code == "empty"


def test_slots_lie_in_the_data_folder_of_the_checkout(monkeypatch):
    monkeypatch.delenv("PADDOCK_DATA", raising=False)
    assert default_directory() == CHECKOUT / "data" / "locks"
