"""``.github/workflows/release.yml``: it is read as YAML, builds for every supported Python, and calls what exists."""

from __future__ import annotations

import re
import tomllib
from importlib.util import find_spec

import pytest
import yaml

from scripts import lock
from tests.shared import CHECKOUT

PATH = CHECKOUT / ".github" / "workflows" / "release.yml"


@pytest.fixture(scope="module")
def jobs():
    return yaml.safe_load(PATH.read_text())["jobs"]


def commands(job) -> list[str]:
    return [step["run"] for step in job["steps"] if "run" in step]


def test_wheels_are_built_for_every_supported_python(jobs):
    chooser = (CHECKOUT / "scripts" / "choose-python.sh").read_text()
    (first, last) = re.search(r"\(3, (\d+)\) <= sys.version_info\[:2\] <= \(3, (\d+)\)", chooser).groups()
    supported = lock.pythons(tomllib.loads((CHECKOUT / "pyproject.toml").read_text()))
    assert supported == [f"3.{minor}" for minor in range(int(first), int(last) + 1)]
    assert jobs["wheels"]["strategy"]["matrix"]["python"] == supported
    readme = (CHECKOUT / "README.md").read_text()
    assert f"Python {supported[0]} to {supported[-1]}" in readme


def test_every_command_of_make_exists(jobs):
    makefile = (CHECKOUT / "Makefile").read_text()
    called = [command.split()[1] for job in jobs.values() for command in commands(job) if command.startswith("make ")]
    assert sorted(called) == ["package", "sbom", "wheels"]
    assert all(re.search(rf"^{target}:", makefile, re.M) for target in called)


def test_only_the_release_may_write_and_only_for_a_tag(jobs):
    workflow = yaml.safe_load(PATH.read_text())
    assert workflow["permissions"] == {"contents": "read"}
    assert [name for name, job in jobs.items() if "permissions" in job] == ["release"]
    assert jobs["release"]["if"] == "github.ref_type == 'tag'"
    assert sorted(jobs["release"]["needs"]) == ["images", "package", "wheels"]


def test_the_release_has_checksums_of_everything_and_no_host_is_named(jobs):
    checksums, _sign, release = commands(jobs["release"])
    assert checksums == "sha256sum -- * > SHA256SUMS" and "dist/*" in release
    assert "://" not in PATH.read_text()


def test_the_checksums_are_signed_where_there_is_a_key(jobs):
    (step,) = [step for step in jobs["release"]["steps"] if step.get("name", "").startswith("Sign")]
    assert step["run"].startswith('[ -n "$MINISIGN_KEY" ] || exit 0\n') and "minisign -S" in step["run"]
    assert step["env"] == {"MINISIGN_KEY": "${{ secrets.MINISIGN_KEY }}"}


def test_every_image_is_built_for_both_processors_and_pushed_only_to_a_named_registry(jobs):
    job = jobs["images"]
    platforms = {one["platform"]: one["machine"] for one in job["strategy"]["matrix"]["include"]}
    assert platforms == {"amd64": "ubuntu-22.04", "arm64": "ubuntu-22.04-arm"}
    build, golden, push, _listed = (step for step in job["steps"] if "run" in step)
    targets = set(re.findall(r"for target in ([a-z ]+);", build["run"])[0].split())
    stages = set(re.findall(r"^FROM \S+ AS (\S+)", (CHECKOUT / "Containerfile").read_text(), re.M))
    assert targets == {"site", "worker", "trainer", "video", "embedded"} <= stages
    assert find_spec(re.findall(r"python -m ([\w.]+)", golden["run"])[0])
    assert push["if"] == "github.ref_type == 'tag' && env.REGISTRY != ''"


def test_the_bills_of_materials_name_everything_that_is_locked():
    makefile = (CHECKOUT / "Makefile").read_text()
    recipe = re.search(r"^sbom:.*\n((?:\t.*\n)+)", makefile, re.M)[1]
    assert {"locks/run.txt", "locks/training.txt", "constraints.txt"} <= set(re.findall(r"\S+\.txt", recipe))
    assert re.search(r"^cyclonedx-bom==", (CHECKOUT / "locks/tools.txt").read_text(), re.M)
    assert re.search(r"^torch==", (CHECKOUT / "constraints.txt").read_text(), re.M)


def test_every_job_ends_and_names_its_machine(jobs):
    assert all(job["timeout-minutes"] <= 60 for job in jobs.values())
    assert {job["runs-on"] for job in jobs.values()} == {"ubuntu-22.04", "${{ matrix.machine }}"}
