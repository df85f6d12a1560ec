"""Addresses of log-in, with those of a provider: in the place of django-allauth's own list."""

from django.urls import include, path

from . import views

urlpatterns = [
    path("", include("allauth.account.urls")),
    path("2fa/", include("allauth.mfa.urls")),
    path("3rdparty/", views.OwnConnectionsView.as_view(), name="socialaccount_connections"),
    path("3rdparty/signup/", views.FirstLogInView.as_view(), name="socialaccount_signup"),
    path("oidc/<slug:provider_id>/login/", views.begin, name="openid_connect_login"),
    path("oidc/<slug:provider_id>/login/callback/", views.callback, name="openid_connect_callback"),
]
