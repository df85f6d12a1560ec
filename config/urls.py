"""URLs of the site; each room has its own, and the API is assembled in config.api."""

from allauth.account.decorators import secure_admin_login
from allauth.account.views import LoginView
from django.conf import settings
from django.contrib import admin
from django.urls import include, path
from django.utils.functional import SimpleLazyObject
from django.views.decorators.csrf import csrf_exempt
from django.views.generic import RedirectView
from django.views.i18n import set_language

from accounts.signing_in.forms import LoginForm, SignUpForm
from accounts.signing_in.views import PasskeyLogInView, SignUpView

from . import views
from .guides import views as guides
from .operations import api as operations_api
from .operations import views as workers

# One log-in: the admin site uses the site's own form, with its limits and its second factor
admin.site.login = secure_admin_login(admin.site.login)  # type: ignore[method-assign]
# Django lists all applications for each page of the admin site, but most pages find the side bar drawn
list_applications = admin.site.get_app_list
admin.site.get_app_list = lambda *which: SimpleLazyObject(lambda: list_applications(*which))  # type: ignore

log_in: type[LoginView] = LoginView
if settings.LDAP:
    from accounts.single_sign_on.views import DirectoryLogInView as log_in

handler500 = "config.views.server_error"
urlpatterns = [
    path("about/", views.about, name="about"),
    path("guides/", guides.guides, name="guides"),
    path("guides/<slug:slug>/", guides.guide, name="guide"),
    path("favicon.ico", views.favicon, name="favicon"),
    path("stream/", views.stream, name="stream"),
    path("stream/clock", views.stream_clock, name="stream_clock"),
    path("theme/", views.set_theme, name="theme"),
    path("health/live", views.health_live, name="health_live"),
    path("health/ready", views.health_ready, name="health_ready"),
    path("metrics", views.metrics, name="metrics"),
    path("status/", workers.status, name="status"),
    path("api/v1/status/", operations_api.StatusView.as_view(), name="api-status"),
    path("api/", include("config.api.urls")),
    path("needs/", workers.needs, name="needs"),
    path("workers/", workers.workers, name="workers"),
    path("workers/<slug:name>/failed/", workers.failed, name="failed_runs"),
    path("", include("config.sharing.urls")),
    path("", include("league.urls")),
    path("", include("races.urls")),  # tried in order, so those that many ask for come early
    path("", include("accounts.urls")),
    path("", include("training.urls")),
    path("", include("courses.urls")),
    path("", include("evaluation.urls")),
    path("", include("tracks.urls")),
    path("accounts/login/", log_in.as_view(form_class=LoginForm), name="account_login"),
    path("accounts/signup/", SignUpView.as_view(form_class=SignUpForm), name="account_signup"),
    *(
        [path("accounts/2fa/webauthn/login/", PasskeyLogInView.as_view(), name="mfa_login_webauthn")]
        if "webauthn" in settings.MFA_SUPPORTED_TYPES
        else []
    ),
    path("accounts/", include("accounts.single_sign_on.urls" if settings.OIDC or settings.LDAP else "allauth.urls")),
    # without a token, so that pages for guests need none: a cookie with a language is all that it makes
    path("i18n/setlang/", csrf_exempt(set_language), name="set_language"),
    # the admin site's own form for it has no limit on guesses of the old one
    path("admin/password_change/", RedirectView.as_view(pattern_name="account_change_password")),
    path("admin/", admin.site.urls),
]
