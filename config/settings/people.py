"""Settings of accounts: log-in, second factor, single sign-on, e-mail."""

from urllib.parse import unquote, urlsplit

from django.core.exceptions import ImproperlyConfigured
from django.utils.translation import gettext_lazy as _

from .env import env_bool, env_choice, env_int, env_regions, env_sender, env_url, passkeys_work
from .single_sign_on import env_domains, ldap, openid_connect, password_racers, roles
from .site import BEHIND_HTTPS, DATA_DIR, INSTALLED_APPS, SITE_URL

COUNTRIES_OVERRIDE = {"XK": _("Kosovo")}  # no code of ISO 3166 yet, but one that its people use
# Which countries score for which region; empty: those of the United Nations (accounts.profile.regions)
REGIONS = env_regions("PADDOCK_REGIONS")
AUTH_USER_MODEL = "accounts.Racer"
# The first has the last word; the others are named for the sessions that were begun with them
AUTHENTICATION_BACKENDS = [
    "accounts.backends.PasswordBackend",
    "django.contrib.auth.backends.ModelBackend",
    "allauth.account.auth_backends.AuthenticationBackend",
]
AUTH_PASSWORD_VALIDATORS = [
    {"NAME": f"django.contrib.auth.password_validation.{name}"}
    for name in ("UserAttributeSimilarityValidator", "MinimumLengthValidator", "CommonPasswordValidator")
]
ACCOUNT_USER_MODEL_USERNAME_FIELD = "alias"
ACCOUNT_LOGIN_METHODS = {"email", "username"}
ACCOUNT_SIGNUP_FIELDS = ["email*", "username*", "password1*", "password2*"]
ACCOUNT_USERNAME_VALIDATORS = "accounts.models.ALIAS_VALIDATORS"
ACCOUNT_USERNAME_MIN_LENGTH = 2
ACCOUNT_EMAIL_SUBJECT_PREFIX = f"[{urlsplit(SITE_URL).hostname}] "
# Domains of e-mail addresses that may sign up; empty: any. Anybody can type an address, so these must be verified
SIGN_UP_DOMAINS = env_domains("PADDOCK_SIGN_UP_DOMAINS")
_verification = "mandatory" if SIGN_UP_DOMAINS else "optional"
ACCOUNT_EMAIL_VERIFICATION = env_choice("PADDOCK_EMAIL_VERIFICATION", _verification, ("none", "optional", "mandatory"))
ACCOUNT_PRESERVE_USERNAME_CASING = True
ACCOUNT_CHANGE_EMAIL = True
ALLAUTH_TRUSTED_PROXY_COUNT = env_int("PADDOCK_TRUSTED_PROXIES", 0)
ACCOUNT_ADAPTER = "accounts.signing_in.adapter.AccountAdapter"
ACCOUNT_PASSWORD_RESET_TOKEN_GENERATOR = "accounts.signing_in.reset_tokens.ResetTokens"
ACCOUNT_FORMS = {
    "reset_password": "accounts.signing_in.forms.ResetPasswordForm",
    "add_email": "accounts.signing_in.forms.NewAddressForm",
}
ACCOUNT_REAUTHENTICATION_REQUIRED = True
# accounts.signing_in.attempt_limits counts wrong passwords; these limit all requests. A class of 40 behind one address
# signs up and logs in at once. login_failed counts codes of the second factor
ACCOUNT_RATE_LIMITS = {
    "login": "120/m/ip",
    "login_failed": "5/5m/key",
    "signup": "60/m/ip",
    "reauthenticate": "10/10m/user",
    "change_password": "5/5m/user",
}
# --- a second factor: codes of an app, codes on paper, and passkeys where browsers allow them
MFA_ADAPTER = "accounts.signing_in.second_factor.SecondFactorAdapter"
MFA_SUPPORTED_TYPES = ["totp", "recovery_codes", *(["webauthn"] if passkeys_work(SITE_URL) else [])]
MFA_PASSKEY_LOGIN_ENABLED = True
MFA_TOTP_TOLERANCE = 1  # the code before and the next one count too: telephones' clocks differ
MFA_WEBAUTHN_ALLOW_INSECURE_ORIGIN = not BEHIND_HTTPS
# A password reset of an address that was never verified removes the second factor too (accounts.signing_in.services)
MFA_ALLOW_UNVERIFIED_EMAIL = True
STAFF_SECOND_FACTOR = env_bool("PADDOCK_STAFF_SECOND_FACTOR", False)
SIGN_UP = env_choice("PADDOCK_SIGN_UP", "open", ("open", "invitation", "sso", "closed"))
# --- single sign-on: applications and pages of it are there only where a provider is set
OIDC, LDAP = openid_connect(), ldap()
SSO_ROLES = roles()
SSO_SESSION_HOURS = env_int("PADDOCK_SSO_SESSION_HOURS", 24, minimum=1)
SSO_VERIFIED_DOMAINS = env_domains("PADDOCK_SSO_VERIFIED_DOMAINS")
PASSWORD_RACERS = password_racers(OIDC or LDAP)
if OIDC or LDAP:
    INSTALLED_APPS += ["allauth.socialaccount", "accounts.single_sign_on"]
    SOCIALACCOUNT_ADAPTER = "accounts.single_sign_on.adapter.SingleSignOnAdapter"
    SOCIALACCOUNT_FORMS = {"signup": "accounts.single_sign_on.forms.AliasForm"}
    SOCIALACCOUNT_AUTO_SIGNUP = False  # the alias is chosen by its racer
    SOCIALACCOUNT_EMAIL_AUTHENTICATION_AUTO_CONNECT = True  # after the adapter has found the account safe
    MFA_PASSKEY_LOGIN_ENABLED = not PASSWORD_RACERS
if LDAP:
    AUTHENTICATION_BACKENDS.insert(0, "accounts.single_sign_on.backends.DirectoryBackend")
# The operator's own pages, linked at the foot of every page
FOOT_LINKS = {
    "chat": env_url("PADDOCK_CHAT_URL", "", ("https", "http"), "https://chat.example.org"),
    "tips": env_url("PADDOCK_TIPS_URL", "", ("https", "http"), "https://example.org/tips"),
    "forum": env_url("PADDOCK_FORUM_URL", "", ("https", "http"), "https://forum.example.org"),
    "terms": env_url("PADDOCK_TERMS_URL", "", ("https", "http"), "https://example.org/terms"),
    "privacy": env_url("PADDOCK_PRIVACY_URL", "", ("https", "http"), "https://example.org/privacy"),
}
LOGIN_URL = "account_login"
LOGIN_REDIRECT_URL = "home"
LOGOUT_REDIRECT_URL = "home"
# E-mail goes to files in the data folder unless an SMTP server is named
_SMTP = "smtp://user:password@host:587/?tls=True"
EMAIL_CONFIG_URL = env_url("EMAIL_URL", "", ("smtp",), _SMTP)
if EMAIL_CONFIG_URL:
    _mail = urlsplit(EMAIL_CONFIG_URL)
    EMAIL_BACKEND = "django.core.mail.backends.smtp.EmailBackend"
    EMAIL_HOST, EMAIL_PORT = _mail.hostname, _mail.port or 25
    EMAIL_HOST_USER, EMAIL_HOST_PASSWORD = unquote(_mail.username or ""), unquote(_mail.password or "")
    if _mail.query not in ("", "tls=True", "tls=False"):
        raise ImproperlyConfigured(f"EMAIL_URL must be an address such as {_SMTP}.")
    EMAIL_USE_TLS = _mail.query == "tls=True"
else:
    EMAIL_BACKEND = "core.mail.FolderBackend"
    EMAIL_FILE_PATH = DATA_DIR / "mail"
    EMAIL_FILE_PATH.mkdir(mode=0o700, exist_ok=True)
EMAIL_TIMEOUT = 20
DEFAULT_FROM_EMAIL = env_sender("PADDOCK_FROM_EMAIL", "paddock@localhost")
