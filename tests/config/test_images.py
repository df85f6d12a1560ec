"""``Containerfile``, ``compose.yaml`` and what lies beside them: who runs, what is set, and what goes in."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml
from celery.bin.celery import celery

from config.operations.run import programs
from config.urls import urlpatterns
from tests.docs.pages import section, text
from tests.docs.test_settings import READ_BY_LIBRARIES, variables
from tests.shared import CHECKOUT

FILE = (CHECKOUT / "Containerfile").read_text().replace("\\\n", " ")
TARGETS = {"site", "worker", "trainer", "video", "embedded"}
OF_PYTHON_AND_PIP = {"PATH", "PYTHONDONTWRITEBYTECODE", "PYTHONUNBUFFERED"}
OURS = ("setup", "site", "streams", "messenger", "worker", "trainer", "video")
SECRET = re.compile(r"KEY|PASSWORD|SECRET|TOKEN")


def stages() -> dict[str, tuple[str, list[tuple[str, str]]]]:
    """By name: what a stage stands on, and its instructions with what follows them."""
    found: dict[str, tuple[str, list[tuple[str, str]]]] = {}
    for line in FILE.splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "FROM":
            base, name = rest.split(" AS ")
            found[name] = (base, current := [])
        elif word.isupper() and word.isalpha() and found:
            current.append((word, rest.strip()))
    return found


STAGES = stages()


def instructions(target: str) -> list[tuple[str, str]]:
    """Those of a target and of all that it stands on, the first ones first."""
    base, own = STAGES[target]
    return (instructions(base) if base in STAGES else []) + own


def last(target: str, word: str) -> str:
    return [rest for one, rest in instructions(target) if one == word][-1]


@pytest.fixture(scope="module")
def compose():
    return yaml.safe_load((CHECKOUT / "compose.yaml").read_text())


def test_there_is_an_image_for_each_kind_of_program():
    assert set(STAGES) >= TARGETS
    assert list(STAGES)[-1] == "site"  # of a build without a target


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_no_image_runs_as_root_and_each_keeps_its_data_in_one_volume(target):
    assert last(target, "USER") == "10001:10001"
    assert last(target, "VOLUME") == "/data"
    assert "useradd --uid 10001" in last("system", "RUN")


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_each_image_has_a_check_whose_program_exists(target):
    check = last(target, "HEALTHCHECK").partition("CMD ")[2]
    if target in ("site", "embedded"):
        (path,) = re.findall(r"http://127\.0\.0\.1:8000/([\w/]+)", check)
        assert path in {str(getattr(one.pattern, "_route", "")) for one in urlpatterns}
    else:
        queue = {"worker": "worker", "trainer": "trainer", "video": "video-worker"}[target]
        words = shlex.split(check)
        assert words[:4] == ["celery", "--broker", "$CELERY_BROKER_URL", "inspect"] and words[-1] == "ping"
        assert f"{queue}@$(hostname)" in words and f"{queue}@%h" in last(target, "CMD")
        assert {"inspect", "worker"} <= set(celery.commands)


@pytest.mark.parametrize(("target", "name"), [("worker", "worker"), ("trainer", "trainer"), ("video", "video-worker")])
def test_workers_are_started_as_run_starts_them(target, name, settings):
    settings.TRAINING = settings.VIDEOS = True
    command = programs("127.0.0.1", 8000)[name]
    words = set(re.findall(r"--?[\w-]+", " ".join(command))) - {"--quiet", "-m", "-P"}
    assert words <= set(re.findall(r"--?[\w-]+", last(target, "CMD")))


def test_the_images_set_nothing_but_documented_settings():
    named = {name for stage in ("run", *TARGETS) for name in _set_by(stage)}
    assert named <= variables() | OF_PYTHON_AND_PIP


def _set_by(stage: str) -> set[str]:
    return {name for word, rest in STAGES[stage][1] if word == "ENV" for name in re.findall(r"(\w+)=", rest)}


def test_no_secret_is_built_in():
    set_or_asked = re.findall(r"^(?:ENV|ARG) (.*)$", FILE, re.M)
    assert not any(SECRET.search(line) for line in set_or_asked)
    making = last("code", "RUN")
    assert "PADDOCK_DATA=/tmp/data" in making and "rm -rf /tmp/data" in making  # with the key that the settings make


def test_only_listed_folders_reach_the_build():
    lines = (CHECKOUT / ".dockerignore").read_text().splitlines()
    rules = [line for line in lines if line and not line.startswith("#")]
    assert rules[0] == "*"
    let_in = {rule[1:] for rule in rules if rule.startswith("!")}
    assert all((CHECKOUT / name).exists() for name in let_in)
    assert not let_in & {"data", "tests", "benchmarks", ".git", ".env", "dist"}
    rooms = {path.name for path in CHECKOUT.iterdir() if (path / "__init__.py").exists()}
    assert rooms - {"tests", "benchmarks"} <= let_in
    assert {"templates", "static", "locale", "docs", "manage.py"} <= let_in


@pytest.mark.parametrize("name", OURS)
def test_our_programs_get_documented_settings_alone(compose, name):
    described, known = section(text("operators.md"), "## Environment variables"), variables() | READ_BY_LIBRARIES
    for variable in compose["services"][name]["environment"]:
        assert variable in known
        assert f"`{variable}`" in described


@pytest.mark.parametrize("name", OURS)
def test_our_programs_can_write_nothing_and_gain_nothing(compose, name):
    service = compose["services"][name]
    assert service["read_only"] and service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert "user" not in service and "privileged" not in service and "ports" not in service


def test_what_runs_code_of_strangers_has_no_way_out(compose):
    assert compose["networks"]["inside"] == {"internal": True}
    for name in ("worker", "trainer", "video", "streams", "setup", "postgres", "valkey", "s3"):
        assert compose["services"][name]["networks"] == ["inside"]
    assert [name for name, one in compose["services"].items() if "ports" in one] == ["caddy"]


def test_every_value_of_the_operator_is_in_the_example_and_on_the_page(compose):
    asked = set(re.findall(r"\$\{(\w+)", (CHECKOUT / "compose.yaml").read_text()))
    example = (CHECKOUT / "containers/example.env").read_text()
    needed = {name for name in asked if not name.endswith(("IMAGE", "IMAGES", "IMAGES_TAG"))}
    assert needed == set(re.findall(r"^(\w+)=", example, re.M))
    assert not re.search(r"^\w*(?:KEY|PASSWORD)=.", example, re.M)
    page = section(text("operators.md"), "## Containers")
    assert all(f"`{name}`" in page for name in asked)
    assert all(name in text("operators.md") for name in re.findall(r"^# (\w+)=", example, re.M))
    assert "/.env" in (CHECKOUT / ".gitignore").read_text().splitlines()


def test_the_services_are_those_of_several_machines(compose):
    built = {one["build"]["target"] for one in compose["services"].values() if "build" in one}
    assert built == TARGETS - {"embedded"}
    assert set(compose["services"]) == {*OURS, "postgres", "valkey", "s3", "caddy"}
    for name in set(OURS) - {"setup"}:
        assert compose["services"][name]["depends_on"] == {"setup": {"condition": "service_completed_successfully"}}


def test_the_full_sandbox_is_for_those_who_run_networks(compose):
    more = yaml.safe_load((CHECKOUT / "containers/level3.yaml").read_text())["services"]
    assert set(more) == {"site", "worker", "trainer"} < set(compose["services"])
    for service in more.values():
        assert service["environment"] == {"PADDOCK_SANDBOX_LEVEL": "3"}
        assert "seccomp=containers/seccomp.json" in service["security_opt"]


def test_the_profile_allows_namespaces_and_no_more():
    profile = json.loads((CHECKOUT / "containers/seccomp.json").read_text())
    assert profile["defaultAction"] == "SCMP_ACT_ERRNO"
    (rule,) = profile["syscalls"]
    assert {"clone", "unshare", "mount", "umount2", "pivot_root", "sethostname", "landlock_restrict_self"} <= set(
        rule["names"]
    )
    for call in ("ptrace", "bpf", "keyctl", "init_module", "kexec_load", "setns", "open_by_handle_at", "userfaultfd"):
        assert call not in rule["names"]


@pytest.mark.soak
def test_a_car_drives_in_a_container(tmp_path):
    script = CHECKOUT / "scripts" / "try_images.sh"
    missing = [program for program in ("debootstrap", "buildah", "podman") if not shutil.which(program)]
    if missing or os.geteuid():
        pytest.skip(f"needs root and Debian's packages debootstrap, buildah and podman; missing: {missing}")
    place = Path(os.environ.get("PADDOCK_IMAGES", tmp_path))
    done = subprocess.run([script, "--place", place, "worker", "embedded"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert '"racer":"driver"' in done.stdout.replace(" ", "")
