"""Addresses of the site. Each room has its own pages; the API is put together in config.api."""

from allauth.account.decorators import secure_admin_login
from allauth.account.views import LoginView
from django.conf import settings
from django.contrib import admin
from django.urls import include, path
from django.views.decorators.csrf import csrf_exempt
from django.views.generic import RedirectView
from django.views.i18n import set_language

from accounts.forms import LoginForm, SignUpForm
from accounts.views import account

from .views import guides, site, workers

# One log-in: who is not logged in is sent to the site's own form, with its limits and its second factor
admin.site.login = secure_admin_login(admin.site.login)  # type: ignore[method-assign]

urlpatterns = [
    path("about/", site.about, name="about"),
    path("guides/", guides.guides, name="guides"),
    path("guides/<slug:slug>/", guides.guide, name="guide"),
    path("favicon.ico", site.favicon, name="favicon"),
    path("stream/", site.stream, name="stream"),
    path("stream/clock", site.stream_clock, name="stream_clock"),
    path("theme/", site.set_theme, name="theme"),
    path("health/live", site.health_live, name="health_live"),
    path("health/ready", site.health_ready, name="health_ready"),
    path("workers/", workers.workers, name="workers"),
    path("workers/<slug:name>/failed/", workers.failed, name="failed_runs"),
    path("", include("league.urls")),
    path("", include("accounts.urls")),
    path("", include("training.urls")),
    path("", include("races.urls")),
    path("", include("evaluation.urls")),
    path("", include("tracks.urls")),
    path("accounts/login/", LoginView.as_view(form_class=LoginForm), name="account_login"),
    path("accounts/signup/", account.SignUpView.as_view(form_class=SignUpForm), name="account_signup"),
    *(
        [path("accounts/2fa/webauthn/login/", account.PasskeyLogInView.as_view(), name="mfa_login_webauthn")]
        if "webauthn" in settings.MFA_SUPPORTED_TYPES
        else []
    ),
    path("accounts/", include("allauth.urls")),
    path("api/", include("config.api.urls")),
    # without a token, so that pages for guests need none: a cookie with a language is all that it makes
    path("i18n/setlang/", csrf_exempt(set_language), name="set_language"),
    # the admin site's own form for it has no limit on guesses of the old one
    path("admin/password_change/", RedirectView.as_view(pattern_name="account_change_password")),
    path("admin/", admin.site.urls),
]
