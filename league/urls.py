"""Addresses of the site. Each room has its own pages; the API is put together in league.api."""

from allauth.account.decorators import secure_admin_login
from allauth.account.views import LoginView
from django.conf import settings
from django.contrib import admin
from django.urls import include, path, re_path
from django.views.decorators.csrf import csrf_exempt
from django.views.generic import RedirectView
from django.views.i18n import set_language

from .forms import LoginForm, SignUpForm
from .views import account, home, notices, organising, racers, seasons, site, webhooks, workers

# One door: who is not logged in is sent to the site's own form, with its limits and its second factor
admin.site.login = secure_admin_login(admin.site.login)  # type: ignore[method-assign]

urlpatterns = [
    path("", home.home, name="home"),
    path("about/", site.about, name="about"),
    path("racers/<str:alias>/", racers.racer, name="racer"),
    path("seasons/", seasons.seasons, name="seasons"),
    path("seasons/new/", organising.season_new, name="season_new"),
    path("seasons/now/", seasons.season_now, name="season_now"),
    path("seasons/<slug:slug>/", seasons.season, name="season"),
    path("seasons/<slug:slug>/standings/", seasons.standings, name="season_standings"),
    re_path(
        r"^seasons/(?P<slug>[-\w]+)/standings\.(?P<form>json|csv|atom)$", seasons.standings_file, name="standings_file"
    ),
    path("seasons/<slug:slug>/finales/", seasons.fields, name="season_fields"),
    path("seasons/<slug:slug>/rules/", seasons.rules, name="season_rules"),
    path("seasons/<slug:slug>/calendar/", seasons.calendar, name="season_calendar"),
    path("seasons/<slug:slug>/calendar.ics", seasons.calendar_file, name="season_calendar_file"),
    path("seasons/<slug:slug>/racers/<str:alias>/", seasons.season_racer, name="season_racer"),
    path("hall-of-fame/", seasons.hall, name="hall"),
    path("settings/", account.settings_page, name="settings"),
    path("notices/", notices.notices, name="notices"),
    path("notices/read/", notices.notices_read, name="notices_read"),
    path("notices/stop/<str:token>/", notices.notices_stop, name="notices_stop"),
    path("notices/<int:pk>/", notices.notice_open, name="notice_open"),
    path("settings/notices/", notices.notice_settings, name="notice_settings"),
    path("settings/webhooks/", webhooks.webhooks, name="webhooks"),
    path("settings/webhooks/<int:pk>/remove/", webhooks.webhook_remove, name="webhook_remove"),
    path("settings/webhooks/<int:pk>/test/", webhooks.webhook_test, name="webhook_test"),
    path("settings/webhooks/<int:pk>/secret/", webhooks.webhook_secret, name="webhook_secret"),
    path("settings/tokens/", account.api_tokens, name="api_tokens"),
    path("settings/tokens/<str:key>/revoke/", account.api_token_revoke, name="api_token_revoke"),
    path("favicon.ico", site.favicon, name="favicon"),
    path("workers/", workers.workers, name="workers"),
    path("workers/<slug:name>/failed/", workers.failed, name="failed_runs"),
    path("theme/", site.set_theme, name="theme"),
    path("health/live", site.health_live, name="health_live"),
    path("health/ready", site.health_ready, name="health_ready"),
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
    path("api/", include("league.api.urls")),
    # without a token, so that pages for guests need none: a cookie with a language is all that it makes
    path("i18n/setlang/", csrf_exempt(set_language), name="set_language"),
    # the admin site's own form for it has no limit on guesses of the old one
    path("admin/password_change/", RedirectView.as_view(pattern_name="account_change_password")),
    path("admin/", admin.site.urls),
]
