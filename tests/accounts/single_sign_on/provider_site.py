"""An OpenID Connect provider in a process of its own: django-oauth-toolkit, which shares no code with the client.

    python -m tests.accounts.single_sign_on.provider_site PORT FOLDER CALLBACK...

People log in there with :data:`PASSWORD`. ``FOLDER/people.json`` has their claims by name, read for each token;
``FOLDER/fault`` names one thing that goes wrong with tokens: ``key``, ``nonce``, ``audience``, ``person``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

PASSWORD = "the provider's own password"
CLIENT, SECRET = "paddock", "the secret of the client"
FORM = """<form method="post">{% csrf_token %}{{ form.as_p }}<button>Sign in at the provider</button></form>"""


def claims_of(folder: Path, name: str) -> dict[str, Any]:
    return json.loads((folder / "people.json").read_text()).get(name, {})


def fault(folder: Path) -> str:
    path = folder / "fault"
    return path.read_text() if path.exists() else ""


def main(port: int, folder: Path, callbacks: list[str]) -> None:
    import django
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric import rsa
    from django.conf import settings

    def key() -> str:
        made = rsa.generate_private_key(public_exponent=65537, key_size=2048)
        pkcs8, plain = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        return made.private_bytes(serialization.Encoding.PEM, pkcs8, plain).decode()

    settings.configure(
        SECRET_KEY="provider",
        ALLOWED_HOSTS=["*"],
        ROOT_URLCONF=__name__,
        USE_TZ=True,
        DEFAULT_AUTO_FIELD="django.db.models.BigAutoField",
        DATABASES={"default": {"ENGINE": "django.db.backends.sqlite3", "NAME": folder / "provider.sqlite3"}},
        INSTALLED_APPS=[
            *("django.contrib.auth", "django.contrib.contenttypes", "django.contrib.sessions", "oauth2_provider")
        ],
        MIDDLEWARE=[
            "django.contrib.sessions.middleware.SessionMiddleware",
            "django.middleware.csrf.CsrfViewMiddleware",
            "django.contrib.auth.middleware.AuthenticationMiddleware",
        ],
        SESSION_COOKIE_NAME="provider_session",  # cookies know no ports
        CSRF_COOKIE_NAME="provider_csrf",
        TEMPLATES=[
            {
                "BACKEND": "django.template.backends.django.DjangoTemplates",
                "OPTIONS": {"loaders": [("django.template.loaders.locmem.Loader", {"log_in.html": FORM})]},
            }
        ],
        PASSWORD_HASHERS=["django.contrib.auth.hashers.MD5PasswordHasher"],
        LOGIN_URL="/log-in/",
        OAUTH2_PROVIDER={
            "OIDC_ENABLED": True,
            "OIDC_RSA_PRIVATE_KEY": key(),
            "PKCE_REQUIRED": True,
            "OAUTH2_VALIDATOR_CLASS": f"{__name__}.Validator",
            "SCOPES": {"openid": "", "profile": "", "email": "", "groups": ""},
        },
        FOLDER=folder,
        OTHER_KEY=key(),
    )
    django.setup()
    from django.contrib.auth.models import User
    from django.core.management import call_command
    from django.core.wsgi import get_wsgi_application
    from oauth2_provider.models import Application
    from waitress import serve

    call_command("migrate", verbosity=0)
    for name in json.loads((folder / "people.json").read_text()):
        User.objects.create_user(name, password=PASSWORD)
    Application.objects.create(
        client_id=CLIENT,
        client_secret=SECRET,
        client_type="confidential",
        authorization_grant_type="authorization-code",
        redirect_uris=" ".join(callbacks),
        skip_authorization=True,
        algorithm="RS256",
    )
    serve(get_wsgi_application(), host="127.0.0.1", port=port, threads=4, _quiet=True)


def _validator() -> type:
    from django.conf import settings
    from jwcrypto import jwk
    from oauth2_provider.oauth2_validators import OAuth2Validator

    class Validator(OAuth2Validator):
        oidc_claim_scope = None  # all claims, whatever the scope

        def get_additional_claims(self, request):
            return {"sub": f"id of {request.user.username}"} | claims_of(settings.FOLDER, request.user.username)

        def finalize_id_token(self, id_token, token, token_handler, request):
            wrong = fault(settings.FOLDER)
            if wrong == "nonce":
                id_token["nonce"] = request.nonce = "another"
            if wrong == "audience":
                id_token["aud"] = "another client"
            if wrong == "key":
                right = request.client.jwk_key
                other = jwk.JWK.from_pem(settings.OTHER_KEY.encode())
                other.thumbprint = right.thumbprint  # its name is that of the right one
                type(request.client).jwk_key = property(lambda client: other)
                try:
                    return super().finalize_id_token(id_token, token, token_handler, request)
                finally:
                    type(request.client).jwk_key = property(lambda client: right)
            return super().finalize_id_token(id_token, token, token_handler, request)

        def get_userinfo_claims(self, request):
            found = super().get_userinfo_claims(request)
            return found | {"sub": "another"} if fault(settings.FOLDER) == "person" else found

    return Validator


def __getattr__(name: str) -> object:
    """Names that settings of the process point to, once it has any."""
    if name == "Validator":
        return _validator()
    if name == "urlpatterns":
        from django.contrib.auth.views import LoginView
        from django.urls import include, path

        return [
            path("log-in/", LoginView.as_view(template_name="log_in.html")),
            path("", include("oauth2_provider.urls", namespace="oauth2_provider")),
        ]
    raise AttributeError(name)


if __name__ == "__main__":
    # by its own name: settings of the process name it, too
    from tests.accounts.single_sign_on import provider_site

    provider_site.main(int(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
