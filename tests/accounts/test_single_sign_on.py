"""A site with a provider (django-oauth-toolkit) and a directory (slapd), both really run: its tests are a run of their
own, because settings decide which applications a process has."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.accounts.single_sign_on import directory_server
from tests.accounts.single_sign_on.provider_site import CLIENT, SECRET
from tests.config.test_run import free_port
from tests.pages.browsing import CHROMIUM
from tests.servers import running, short_folder
from tests.shared import CHECKOUT

HERE = Path(__file__).parent / "single_sign_on"
PROVIDER = pytest.mark.skipif(find_spec("oauth2_provider") is None, reason="django-oauth-toolkit is not installed")
DIRECTORY = pytest.mark.skipif(bool(directory_server.missing()), reason=directory_server.missing())
BROWSER = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium or Chrome; “make test” says what to type")
CALLBACK = "/accounts/oidc/sso/login/callback/"


@pytest.mark.parametrize(
    "files",
    [
        pytest.param("test_openid_connect.py test_hostile_tokens.py", marks=PROVIDER),
        pytest.param("test_directory.py", marks=DIRECTORY),
        pytest.param("../../core/personal_data/test_rules.py", marks=[PROVIDER, pytest.mark.slow]),
        pytest.param("test_journey_browser.py", marks=[PROVIDER, BROWSER, pytest.mark.slow]),
    ],
)
def test_a_site_with_a_provider(files):
    with short_folder() as folder, ExitStack() as servers:
        provider_port, ldap_port, site_port = (free_port() for _ in range(3))
        (folder / "secret").write_text(f"{SECRET}\n")
        (folder / "people.json").write_text('{"mia": {}, "noah": {}, "newcomer": {}}')
        (folder / "slapd").mkdir()
        settings = {
            "PADDOCK_OIDC_ISSUER": f"http://127.0.0.1:{provider_port}",
            "PADDOCK_OIDC_CLIENT_ID": CLIENT,
            "PADDOCK_OIDC_CLIENT_SECRET_FILE": str(folder / "secret"),
            "PADDOCK_OIDC_LABEL": "Example University",
            "PADDOCK_SSO_GROUPS": "Paddock-Admins=admin,stewards=steward,staff=teacher,writers=group:Writers",
            "PADDOCK_TEST_PROVIDER": str(folder),
        }
        if files == "test_directory.py":
            (folder / "reader").write_text(directory_server.READER_PASSWORD)
            authority = servers.enter_context(directory_server.directory(folder / "slapd", ldap_port))
            settings |= {
                "PADDOCK_LDAP_URI": f"ldap://127.0.0.1:{ldap_port}",
                "PADDOCK_LDAP_LABEL": "Example LDAP",
                "PADDOCK_LDAP_BIND_DN": directory_server.READER,
                "PADDOCK_LDAP_BIND_PASSWORD_FILE": str(folder / "reader"),
                "PADDOCK_LDAP_USER_BASE": f"ou=people,{directory_server.SUFFIX}",
                "PADDOCK_LDAP_USER_FILTER": "(|(uid=%(user)s)(mail=%(user)s))",
                "PADDOCK_LDAP_GROUP_BASE": f"ou=groups,{directory_server.SUFFIX}",
                "PADDOCK_LDAP_CA_FILE": str(authority),
            }
        else:
            callbacks = [f"http://testserver{CALLBACK}", f"http://127.0.0.1:{site_port}{CALLBACK}"]
            name = "tests.accounts.single_sign_on.provider_site"
            command = [sys.executable, "-m", name, str(provider_port), str(folder), *callbacks]
            servers.enter_context(running(command, lambda: _answers(provider_port)))
        run = subprocess.run(
            [
                *(sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", "not soak"),
                *(f"--liveserver=127.0.0.1:{site_port}", *(str(HERE / file) for file in files.split())),
            ],
            cwd=CHECKOUT,
            env={name: value for name, value in os.environ.items() if not name.startswith(("PADDOCK_", "PYTEST_"))}
            | settings,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
    assert run.returncode == 0 and " passed" in run.stdout and " skipped" not in run.stdout, run.stdout[-12000:]


def _answers(port: int) -> bool:
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0
