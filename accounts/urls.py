"""Addresses of the pages of accounts; django-allauth brings those of log-in."""

from django.urls import include, path

from .leaving import views as leaving
from .pictures import views as pictures
from .profile import views as profile
from .programs import views as programs
from .signing_in import views as signing_in
from .tokens import views as tokens
from .usage import views as usage

urlpatterns = [
    path("settings/", profile.settings_page, name="settings"),
    path("settings/alias/", profile.alias_page, name="alias"),
    path("settings/tokens/", tokens.api_tokens, name="api_tokens"),
    path("settings/tokens/<str:key>/revoke/", tokens.api_token_revoke, name="api_token_revoke"),
    path("programs/", programs.programs, name="programs"),
    path("programs/<str:alias>/", programs.program, name="program"),
    path("join/<str:code>/", signing_in.invitation, name="sign_up_invitation"),
    path("settings/data/", leaving.own_data, name="own_data"),
    path("settings/data/download/", leaving.data_download, name="data_download"),
    path("settings/data/delete/", leaving.account_delete, name="own_account_delete"),
    path("settings/usage/", usage.usage, name="usage"),
    path("settings/picture/", pictures.picture_set, name="picture_set"),
    path("settings/picture/remove/", pictures.picture_remove, name="picture_remove"),
    path("avatars/<str:name>.webp", pictures.avatar, name="avatar"),
    path("", include("accounts.groups.urls")),
    path("", include("accounts.teams.urls")),
    path("usage/", usage.usage_of_all, name="usage_of_all"),
]
