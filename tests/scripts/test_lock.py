"""The locks are those of pyproject.toml, and every file in them has a sum."""

from __future__ import annotations

import re
import subprocess
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from scripts import lock
from tests.shared import CHECKOUT

PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())
WANTED = lock.wishes(PROJECT)
PYTHONS = ["3.11", "3.12", "3.13", "3.14"]


def text_of(name: str) -> str:
    return (lock.LOCKS / f"{name}.txt").read_text()


def locked(name: str) -> dict[str, set[str]]:
    return {canonicalize_name(package): versions for package, versions in lock.pins(text_of(name)).items()}


@pytest.mark.parametrize("name", WANTED)
def test_a_lock_is_up_to_date_with_pyproject(name):
    assert text_of(name).splitlines()[0] == lock.heading(WANTED[name]), "run: make lock"


@pytest.mark.parametrize("name", WANTED)
def test_every_requirement_is_locked_at_an_allowed_version(name):
    found = locked(name)
    for wish in map(Requirement, WANTED[name]):
        if wish.name == lock.APART:
            assert canonicalize_name(wish.name) not in found, "torch's builds differ by index"
            continue
        versions = found[canonicalize_name(wish.name)]
        assert versions and all(wish.specifier.contains(version) for version in versions), wish


@pytest.mark.parametrize("name", WANTED)
def test_every_locked_package_has_a_hash_and_no_index_is_named(name):
    text = text_of(name)
    entries = re.findall(r"^(\S+==\S+).*\\\n((?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)", text, re.M)
    assert len(entries) == sum(len(versions) for versions in lock.pins(text).values()) > 5
    assert "://" not in text


def test_tests_and_training_use_the_versions_of_the_site():
    run, test, training = (locked(name) for name in ("run", "test", "training"))
    for other in (test, training):
        assert {package: other[package] for package in run} == run


def test_constraints_are_the_versions_of_the_locks_and_torch():
    assert lock.CONSTRAINTS.read_text() == lock.constraints(WANTED)
    assert "torch==2.13.0\n" in lock.CONSTRAINTS.read_text()


def test_a_changed_requirement_makes_a_lock_stale():
    assert lock.heading([*WANTED["run"], "moonphase>=1"]) != lock.heading(WANTED["run"])
    assert lock.heading(list(reversed(WANTED["run"]))) == lock.heading(WANTED["run"])


def test_torchs_builds_are_read_from_the_page_of_its_index():
    page = "".join(
        f'<a href="https://files.example.org/{name}#sha256={digest * 64}" data-core-metadata="sha256=0">{name}</a><br/>'
        for digest, name in (
            ("a", "torch-2.13.0+cpu-cp313-cp313-manylinux_2_28_x86_64.whl"),
            ("b", "torch-2.13.0+cpu-cp313-cp313t-manylinux_2_28_x86_64.whl"),
            ("c", "torch-2.13.0+cpu-cp311-cp311-manylinux_2_28_aarch64.whl"),
            ("d", "torch-2.13.0+cpu-cp313-cp313-win_amd64.whl"),
            ("e", "torch-2.13.0-cp313-cp313-manylinux_2_28_x86_64.whl"),
            ("f", "torch-2.12.0+cpu-cp313-cp313-manylinux_2_28_x86_64.whl"),
        )
    )
    assert lock.builds(page, "torch==2.13.0\n").splitlines() == [
        f"{'c' * 64}  torch-2.13.0+cpu-cp311-cp311-manylinux_2_28_aarch64.whl",
        f"{'a' * 64}  torch-2.13.0+cpu-cp313-cp313-manylinux_2_28_x86_64.whl",
    ]


def test_torchs_lock_is_in_the_order_in_which_make_lock_writes_it():
    lines = [line.split() for line in lock.BUILDS.read_text().splitlines()]
    page = "".join(f'<a href="{name}#sha256={digest}">{name}</a>' for digest, name in lines)
    assert lock.builds(page, lock.CONSTRAINTS.read_text()) == lock.BUILDS.read_text()


def test_the_supported_pythons_are_the_same_everywhere():
    package = tomllib.loads((CHECKOUT / "distribution/pyproject.toml").read_text())
    assert lock.pythons(PROJECT) == lock.pythons(package) == PYTHONS
    assert PROJECT["project"]["requires-python"] == package["project"]["requires-python"] == f">={PYTHONS[0]}"
    assert PROJECT["tool"]["mypy"]["python_version"] == PYTHONS[0]
    assert PROJECT["tool"]["ruff"]["target-version"] == "py311"


@pytest.mark.parametrize("name", WANTED)
def test_a_lock_was_checked_for_wheels_of_every_supported_python(name):
    assert text_of(name).splitlines()[1] == lock.wheels(lock.pythons(PROJECT)), "run: make lock"


@pytest.fixture
def index(tmp_path, monkeypatch):
    """A resolver in the place of uv: it fails where a package is named in ``tmp_path / "VERSION PLATFORM"``."""
    uv = tmp_path / "uv"
    uv.write_text(
        "#!/bin/sh\n"
        "while [ $# -gt 1 ]; do\n"
        "case $1 in --python-version) python=$2;; --python-platform) machine=$2;; esac; shift; done\n"
        f'cat > "{tmp_path}/asked $python $machine"\n'
        f'[ ! -f "{tmp_path}/$python $machine" ]\n'
    )
    uv.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    return tmp_path


def test_wheels_are_required_for_every_python_and_machine(index):
    lock.require_wheels(text_of("run"), PYTHONS)
    asked = list(index.glob("asked *"))
    assert len(asked) == len(PYTHONS) * len(lock.MACHINES)
    for one in asked:
        packages = {line.partition("==")[0] for line in one.read_text().splitlines()}
        assert packages == set(lock.pins(text_of("run"))) - {"pybullet"}
        assert not one.read_text().endswith("\\")


def test_a_package_without_a_wheel_for_one_python_fails_the_lock(index):
    (index / f"3.14 {lock.MACHINES['AArch64']}").touch()
    with pytest.raises(subprocess.CalledProcessError):
        lock.require_wheels(text_of("run"), PYTHONS)
    lock.require_wheels(text_of("run"), PYTHONS[:-1])
