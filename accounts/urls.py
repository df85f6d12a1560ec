"""Addresses of accounts' own pages; log-in and the like are allauth's."""

from django.urls import path

from .views import account, groups, pictures, teams, usage

urlpatterns = [
    path("settings/", account.settings_page, name="settings"),
    path("settings/tokens/", account.api_tokens, name="api_tokens"),
    path("settings/tokens/<str:key>/revoke/", account.api_token_revoke, name="api_token_revoke"),
    path("join/<str:code>/", usage.invitation, name="sign_up_invitation"),
    path("settings/usage/", usage.usage, name="usage"),
    path("settings/picture/", pictures.picture_set, name="picture_set"),
    path("settings/picture/remove/", pictures.picture_remove, name="picture_remove"),
    path("avatars/<str:name>.webp", pictures.avatar, name="avatar"),
    path("groups/", groups.groups, name="groups"),
    path("groups/new/", groups.group_new, name="group_new"),
    path("groups/join/<str:code>/", groups.group_join, name="group_join"),
    path("groups/<slug:slug>/", groups.group, name="group"),
    path("groups/<slug:slug>/leave/", groups.group_leave, name="group_leave"),
    path("teams/", teams.teams, name="teams"),
    path("teams/new/", teams.team_new, name="team_new"),
    path("teams/leave/", teams.team_leave, name="team_leave"),
    path("teams/join/<str:code>/", teams.team_join, name="team_join"),
    path("teams/<slug:slug>/", teams.team, name="team"),
    path("usage/", usage.usage_of_all, name="usage_of_all"),
]
