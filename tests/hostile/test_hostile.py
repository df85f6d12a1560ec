"""Every hostile upload ends with the reason that its folder is named after, and hurts nobody.

``tests/hostile/<reason code>/<case>.py`` has ``build()``, which returns the files to upload as ``(name, bytes)``; and,
where it needs them, ``LIMITS`` (bounds other than the defaults) and ``CHECKPOINT`` (the one that is asked for).
"""

from __future__ import annotations

import importlib.util
import io
import os
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from evaluation.admit import AdmittedPackage, admit
from paddock.errors import PaddockError
from paddock.errors.reasons import conversion, gate, metadata, sb3
from paddock.errors.reasons import upload as upload_reasons
from paddock.packages.limits import DEFAULT_LIMITS, PackageLimits
from paddock.packages.read import UploadPart

from .parts import Upload, good_network, pair

HERE = Path(__file__).parent
CASES = sorted(path.relative_to(HERE).with_suffix("").as_posix() for path in HERE.glob("*/*.py"))
UNREACHABLE = {
    # no network within the limits takes so long or crashes the converter: see tests/packages/test_admit.py
    "conversion_time",
    "conversion_crashed",
}
SECTIONS = (upload_reasons, metadata, conversion, sb3, gate)


def load(case: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"hostile_{case.replace('/', '_')}", HERE / f"{case}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def upload(files: Upload, limits: PackageLimits = DEFAULT_LIMITS, checkpoint: str = "") -> AdmittedPackage:
    return admit([UploadPart(name, io.BytesIO(content)) for name, content in files], limits, checkpoint=checkpoint)


def descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


def children() -> set[str]:
    tasks = Path("/proc/self/task").iterdir()
    return {child for task in tasks for child in (task / "children").read_text().split()}


@pytest.mark.parametrize("case", CASES)
def test_a_hostile_upload_is_refused_with_the_reason_of_its_folder(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
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
    assert (descriptors(), children()) == upload_before, "something was left open or running"
    assert list(tmp_path.iterdir()) == [], "something was written"


def test_after_all_of_them_a_good_model_is_admitted() -> None:
    assert upload(pair(good_network())).parameters == 10


def test_every_reason_for_refusing_a_package_has_a_case() -> None:
    from paddock import packages
    from training import sb3 as policies

    folders = (Path(package.__file__).parent for package in (packages, policies))
    source = "".join(path.read_text() for folder in folders for path in folder.rglob("*.py"))
    codes = {code for section in SECTIONS for code in section.REASONS if f'"{code}"' in source}
    assert codes - {case.split("/")[0] for case in CASES} == UNREACHABLE
