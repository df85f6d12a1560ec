"""The locks are those of pyproject.toml, and every file in them has a sum."""

from __future__ import annotations

import re
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from scripts import lock
from tests.shared import CHECKOUT

WANTED = lock.wishes(tomllib.loads((CHECKOUT / "pyproject.toml").read_text()))


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
