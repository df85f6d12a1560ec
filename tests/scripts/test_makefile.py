"""``make setup`` with stubs in the place of its scripts: what runs, in which order, and when it runs again."""

from __future__ import annotations

import os
import shutil
import subprocess

import pytest

from tests.shared import CHECKOUT

CHOOSE = """#!/bin/sh
echo "choose $*" >>log
[ ! -e gone ] || rm -rf .venv gone
[ ! -e .venv ] || exit 0
mkdir -p .venv/bin
printf '#!/bin/sh\\necho "[$STEP/$STEPS] $*" >>log\\n' >.venv/bin/python
chmod +x .venv/bin/python
touch -d 2020-01-01 .venv/bin/python
"""


@pytest.fixture
def make(tmp_path):
    """Run a target in a folder of stubs; the lines of what it ran."""
    shutil.copy(CHECKOUT / "Makefile", tmp_path)
    for name in ("scripts", "locks"):
        (tmp_path / name).mkdir()
    for lock in (CHECKOUT / "locks").iterdir():
        (tmp_path / "locks" / lock.name).touch()
    (tmp_path / "pyproject.toml").touch()
    for name, text in {"choose-python.sh": CHOOSE, "system-packages.sh": "#!/bin/sh\necho packages $1 >>log\n"}.items():
        (tmp_path / "scripts" / name).write_text(text)
        (tmp_path / "scripts" / name).chmod(0o755)

    def call(*arguments: str) -> list[str]:
        # The make that runs the tests hands its own settings down
        outside = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "PYTHON", "STEPS")}
        (tmp_path / "log").unlink(missing_ok=True)
        subprocess.run(["make", *arguments], cwd=tmp_path, env=outside, check=True, capture_output=True, timeout=60)
        return (tmp_path / "log").read_text().splitlines()

    return call


def test_the_python_is_chosen_before_anything_is_installed(make):
    ran = make("-j4", "setup")
    assert ran[:2] == ["packages run", "choose .venv"]
    (bullet, lock) = (next(i for i, line in enumerate(ran) if part in line) for part in ("build_pybullet", "run.txt"))
    assert bullet < lock
    assert ran[lock].startswith("[3/4] ")


def test_nothing_is_installed_twice(make):
    make("setup")
    assert not any("install" in line for line in make("setup"))


@pytest.mark.parametrize("jobs", ["-j1", "-j4"])
def test_a_new_environment_is_filled_again(make, tmp_path, jobs):
    make("setup")
    (tmp_path / "gone").touch()
    assert any("--requirement locks/run.txt" in line for line in make(jobs, "setup"))


def test_tests_have_five_steps(make):
    ran = make("-j4", "test")
    assert ran[:2] == ["packages test", "choose .venv"]
    assert any(line.startswith("[3/5] ") and "run.txt" in line for line in ran)
    assert any(line.startswith("[5/5] ") and "test.txt" in line for line in ran)
    assert "packages browser" in ran


def test_tests_go_on_where_python_ldap_cannot_be_compiled(make, tmp_path):
    make("setup")
    python = tmp_path / ".venv" / "bin" / "python"
    python.write_text(f"{python.read_text()}case $* in *ldap.txt*) exit 1 ;; esac\n")
    os.utime(python, (0, 0))
    ran = make("test")
    assert any("locks/ldap.txt --no-build-isolation" in line for line in ran)
    assert any("-m pytest" in line for line in ran)
    with pytest.raises(subprocess.CalledProcessError):
        make("ldap")


@pytest.mark.parametrize(
    ("first", "second", "retry", "passes"),
    [
        (0, None, "RETRY=alone", True),
        (1, 0, "RETRY=alone", True),
        (1, 1, "RETRY=alone", False),
        (1, 5, "RETRY=alone", False),  # no failed test is known
        (3, None, "RETRY=alone", False),  # pytest itself broke
        (1, None, "RETRY=", False),
    ],
)
def test_failed_tests_run_once_more_alone_in_ci(make, tmp_path, first, second, retry, passes):
    make("setup")
    python = tmp_path / ".venv" / "bin" / "python"
    statuses = f"case $* in *last-failed*) exit {second} ;; *pytest*) exit {first} ;; esac\n"
    python.write_text(python.read_text() + statuses)
    if passes:
        make("test", retry)
    else:
        with pytest.raises(subprocess.CalledProcessError):
            make("test", retry)
    ran = (tmp_path / "log").read_text().splitlines()
    assert sum("--last-failed" in line and " -n " not in line for line in ran) == (second is not None)


def test_wheels_need_no_environment(make, tmp_path):
    stub = tmp_path / "python3.13"
    stub.write_text('#!/bin/sh\necho "$*" >>log\n')
    stub.chmod(0o755)
    assert make("wheels", f"PYTHON={stub}") == ["scripts/build_pybullet.py"]
    assert not (tmp_path / ".venv").exists()


def test_training_whose_download_broke_off_is_offered_again(make, tmp_path):
    make("setup")
    assert not any("offer_training" in line for line in make("setup"))
    python = tmp_path / ".venv" / "bin" / "python"
    works = python.read_text()
    (tmp_path / ".venv" / ".offered").unlink()
    for text, offered in ((f"{works}case $1 in *offer*) exit 1 ;; esac\n", True), (works, True), (works, False)):
        python.write_text(text)
        os.utime(python, (0, 0))
        assert any("offer_training" in line for line in make("setup")) is offered
