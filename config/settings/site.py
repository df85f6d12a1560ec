"""Settings of the site itself: its folder, address, applications and middleware."""

from pathlib import Path
from urllib.parse import urlsplit

from core.files.secret_files import secret_from_file

from .env import (
    check_url,
    env_bool,
    env_folder,
    env_hosts,
    env_list,
    env_listen,
    env_str,
    env_token,
    env_url,
    private_folder,
)

BASE_DIR = Path(__file__).resolve().parent.parent.parent
DATA_DIR = private_folder("PADDOCK_DATA", env_folder("PADDOCK_DATA", BASE_DIR / "data"))

DEBUG = env_bool("PADDOCK_DEBUG", False)
SECRET_KEY = env_str("PADDOCK_SECRET_KEY", "") or secret_from_file(DATA_DIR / "secret-key")

# Where the site is reached. The host is allowed and trusted for forms; an https address makes cookies secure.
_HTTP = ("http", "https")
SITE_URL = env_url("PADDOCK_SITE_URL", "http://127.0.0.1:8000", _HTTP, "https://paddock.example.org").rstrip("/")
_site_host = urlsplit(SITE_URL).hostname or ""
ALLOWED_HOSTS = [
    f"[{_site_host}]" if ":" in _site_host else _site_host,
    *env_hosts("PADDOCK_HOSTS", "localhost,127.0.0.1"),
]
CSRF_TRUSTED_ORIGINS = [SITE_URL, *env_list("PADDOCK_TRUSTED_ORIGINS")]
for _origin in CSRF_TRUSTED_ORIGINS[1:]:
    check_url("PADDOCK_TRUSTED_ORIGINS", _origin, _HTTP, "https://other.example.org")
BEHIND_HTTPS = SITE_URL.startswith("https://")
SESSION_COOKIE_SECURE = CSRF_COOKIE_SECURE = BEHIND_HTTPS
SECURE_PROXY_SSL_HEADER = ("HTTP_X_FORWARDED_PROTO", "https") if env_bool("PADDOCK_BEHIND_PROXY", False) else None
SECURE_HSTS_SECONDS = 31_536_000 if BEHIND_HTTPS else 0
SESSION_COOKIE_SAMESITE = "Lax"
SESSION_ENGINE = "config.serving.sessions"
X_FRAME_OPTIONS = "DENY"
SECURE_REFERRER_POLICY = "same-origin"

INSTALLED_APPS = [
    "config",
    "league",
    "courses",
    "training",
    "races",
    "videos",
    "evaluation",
    "tracks",
    "accounts",
    "core",
    "django.contrib.admin",
    "django.contrib.auth",
    "django.contrib.contenttypes",
    "django.contrib.humanize",
    "django.contrib.sessions",
    "django.contrib.messages",
    "whitenoise.runserver_nostatic",
    "django.contrib.staticfiles",
    "django.forms",
    "allauth",
    "allauth.account",
    "allauth.mfa",
    "csp",
    "corsheaders",
    "django_countries",
    "django_htmx",
    "rest_framework",
    "knox",
    "drf_spectacular",
]

MIDDLEWARE = [
    "config.middleware.request_ids.RequestIds",
    "core.addresses.ConfiguredLinks",
    "django.middleware.security.SecurityMiddleware",
    "whitenoise.middleware.WhiteNoiseMiddleware",
    "config.middleware.http_caching.PublicReads",
    "config.middleware.http_caching.Compression",
    "config.middleware.http_caching.ConditionalGet",
    "csp.middleware.CSPMiddleware",
    "django.contrib.sessions.middleware.SessionMiddleware",
    "django.middleware.locale.LocaleMiddleware",
    "config.middleware.time_zone.ReaderTimeZone",
    "config.middleware.fresh_reads.FreshReads",
    "config.middleware.page_etags.PageETags",
    "config.middleware.shared_pages.SharedPages",
    "django.middleware.common.CommonMiddleware",
    "django.middleware.csrf.CsrfViewMiddleware",
    "django.contrib.auth.middleware.AuthenticationMiddleware",
    "config.middleware.body_limit.BodyLimit",
    "django.contrib.messages.middleware.MessageMiddleware",
    "django.middleware.clickjacking.XFrameOptionsMiddleware",
    "django_htmx.middleware.HtmxMiddleware",
    "config.middleware.accounts.LoginRedirect",
    "allauth.account.middleware.AccountMiddleware",
    "config.middleware.accounts.ClassAccountPages",
    "config.middleware.accounts.StaffSecondFactor",
    "config.middleware.spoilers.NoSpoilers",
    "config.middleware.platform_faults.PlatformFaults",
]

# Metrics for Prometheus: on a port, behind a token on the site, or (neither is set) none
METRICS_LISTEN = env_listen("PADDOCK_METRICS_LISTEN")
METRICS_TOKEN = env_token("PADDOCK_METRICS_TOKEN")
METRICS_DIR = DATA_DIR / "metrics"
METRICS = METRICS_LISTEN is not None or bool(METRICS_TOKEN)
if METRICS:
    MIDDLEWARE.insert(0, "config.middleware.request_metrics.RequestMetrics")

ROOT_URLCONF = "config.urls"
WSGI_APPLICATION = "config.wsgi.application"
TASK_APPLICATION = "config.celery.app"  # loaded by the first wake-up
FORM_RENDERER = "django.forms.renderers.TemplatesSetting"

TEMPLATES = [
    {
        "BACKEND": "django.template.backends.django.DjangoTemplates",
        "DIRS": [BASE_DIR / "templates"],
        "APP_DIRS": True,
        "OPTIONS": {
            "context_processors": [
                "django.template.context_processors.request",
                "django.template.context_processors.i18n",
                "django.contrib.auth.context_processors.auth",
                "django.contrib.messages.context_processors.messages",
            ],
            "builtins": ["core.templatetags.kept_addresses"],
            "libraries": {"i18n": "core.templatetags.kept_words"},
        },
    },
]
SILENCED_SYSTEM_CHECKS = ["templates.W003"]  # that "i18n" is also Django's
