"""Every hostile upload ends with the reason that its folder is named after, and hurts nobody.

``tests/hostile/<reason code>/<case>.py`` has ``build()``, which returns the files to upload as ``(name, bytes)``; and,
where it needs them, ``LIMITS`` (bounds other than the defaults) and ``CHECKPOINT`` (the one that is asked for).

What converts and gates them answers in this process; the first of each folder meets it in the sandbox as well, and
those of :data:`ONLY_IN_THE_SANDBOX` only there.
"""

from __future__ import annotations

import base64
import importlib.util
import io
import json
import os
import pickle
import time
from contextlib import suppress
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from types import ModuleType

import pytest

from evaluation.garage import admission as admit
from evaluation.garage.admission import AdmittedPackage
from paddock.errors import PaddockError
from paddock.errors.reasons import REASONS
from paddock.packages.limits import DEFAULT_LIMITS, PackageLimits
from paddock.packages.read import UploadPart
from tests.soak import one_of_each

from .here import launch_here
from .parts import Upload, good_network, metadata, pair, zipped

GONE_S = 10.0
HERE = Path(__file__).parent
CASES = sorted(path.relative_to(HERE).with_suffix("").as_posix() for path in HERE.glob("*/*.py"))
UNREACHABLE = {
    # no network within the limits takes so long or crashes the converter: see tests/evaluation/test_admit.py
    "conversion_time",
    "conversion_crashed",
    # no upload is refused for it: see tests/paddock/packages/test_own.py
    "sb3_at_home",
}
ONLY_IN_THE_SANDBOX = ("conversion_memory",)  # whose limit is the process's
IN_A_PROCESS = ("Conversion of a TensorFlow graph", "Policies of stable-baselines3", "The network")
SUBJECTS = ("Upload", "model_metadata.json", *IN_A_PROCESS)


CONVERTED = {code for code, reason in REASONS.items() if reason.subject in IN_A_PROCESS}
FIRST_OF_EACH = [
    next(cases) for code, cases in groupby(CASES, lambda case: case.split("/")[0]) if code in CONVERTED - UNREACHABLE
]
# the way to the sandbox and back is the same for each reason of a subject
KINDS = {case: case.startswith(ONLY_IN_THE_SANDBOX) or REASONS[case.split("/")[0]].subject for case in CASES}


def load(case: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"hostile_{case.replace('/', '_')}", HERE / f"{case}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def upload(files: Upload, limits: PackageLimits = DEFAULT_LIMITS, checkpoint: str = "") -> AdmittedPackage:
    return admit.admit(
        [UploadPart(name, io.BytesIO(content)) for name, content in files], limits, checkpoint=checkpoint
    )


def descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


def children() -> set[str]:
    found: set[str] = set()
    for task in Path("/proc/self/task").iterdir():
        with suppress(FileNotFoundError):  # a thread that has just ended
            found.update((task / "children").read_text().split())
    return found


def is_left(before: tuple[int, set[str]]) -> bool:
    """Whether something stays open or running that was not ``before`` (:func:`descriptors`, :func:`children`). What an
    earlier test held may have gone meanwhile, and a thread of another test may just hold something for a moment."""
    until = time.monotonic() + GONE_S
    while left := descriptors() > before[0] or not children() <= before[1]:
        if time.monotonic() > until:
            break
        time.sleep(0.05)
    return left


def needs_the_sandbox(case: str) -> bool:
    return case.startswith(ONLY_IN_THE_SANDBOX)


def is_refused(case: str, folder: Path) -> None:
    """Fails unless the case ends as its folder says and leaves nothing open, running or, in ``folder``, written."""
    module = load(case)
    files = module.build()
    limits = replace(DEFAULT_LIMITS, **getattr(module, "LIMITS", {}))
    upload_before = descriptors(), children()
    with pytest.raises(PaddockError) as fault:
        upload(files, limits, getattr(module, "CHECKPOINT", ""))
    code = fault.value.code
    assert code == case.split("/")[0], f"{fault.value} {getattr(fault.value, '__notes__', '')}"
    assert fault.value.fault == "user"
    assert str(fault.value) == fault.value.reason.sentence % fault.value.params, "a parameter is missing"
    assert str(fault.value).isprintable()
    assert not is_left(upload_before), "something was left open or running"
    assert list(folder.iterdir()) == [], "something was written"


@pytest.mark.parametrize("case", [case for case in CASES if not needs_the_sandbox(case)])
def test_a_hostile_upload_is_refused_with_its_folders_reason(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(admit, "launch", launch_here)
    is_refused(case, tmp_path)


@pytest.mark.parametrize(
    "case",
    one_of_each(sorted({*FIRST_OF_EACH, *filter(needs_the_sandbox, CASES)}), kind=KINDS.__getitem__),
)
def test_the_sandbox_gives_the_same_reason(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    is_refused(case, tmp_path)


class WritesAFile:
    """What unpickles as a call."""

    def __reduce__(self) -> tuple:
        return os.system, ("touch PWNED",)


def test_pickles_beside_a_policys_weights_are_not_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """stable-baselines3 itself unpickles each ``:serialized:`` value and the optimizer's file."""
    from tests.hostile.policies import SAID, saved, weights

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(admit, "launch", launch_here)
    serialized = base64.b64encode(pickle.dumps(WritesAFile())).decode()
    said = SAID | {name: {":type:": "function", ":serialized:": serialized} for name in ("lr_schedule", "clip_range")}
    said["observation_space"] = {**SAID["observation_space"], ":serialized:": serialized}
    members = {
        "data": json.dumps(said).encode(),
        "policy.pth": saved(weights()),
        "policy.optimizer.pth": saved(WritesAFile()),
        "pytorch_variables.pth": saved(WritesAFile()),
    }
    upload([("model.zip", zipped(*members.items())), ("model_metadata.json", metadata())])
    assert list(tmp_path.iterdir()) == []


def test_a_good_model_is_admitted_after_all_hostile_ones() -> None:
    assert upload(pair(good_network())).parameters == 10


def test_every_reason_to_refuse_a_package_has_a_case() -> None:
    from paddock import packages
    from training import sb3 as policies

    folders = (Path(package.__file__).parent for package in (packages, policies))
    files = [Path(admit.__file__), *(path for folder in folders for path in folder.rglob("*.py"))]
    source = "".join(path.read_text() for path in files)
    codes = {code for code, reason in REASONS.items() if reason.subject in SUBJECTS and f'"{code}"' in source}
    assert codes - {case.split("/")[0] for case in CASES} == UNREACHABLE
