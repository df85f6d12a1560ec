"""Addresses of the pages of the league."""

from django.urls import path, re_path

from .cups import views as cups
from .following import views as following
from .home.views import home
from .invitations import views as invitations
from .notices import views as notices
from .racers.views import racer
from .seasons.views import season_actions, season_planning
from .seasons.views import seasons as season_views
from .standings import views as standings
from .webhooks import views as webhooks

urlpatterns = [
    path("", home, name="home"),
    path("racers/<str:alias>/", racer, name="racer"),
    path("racers/<str:alias>/follow/", following.follow, name="follow"),
    path("racers/<str:alias>/unfollow/", following.unfollow, name="unfollow"),
    path("following/", following.following, name="following"),
    path("races/invited/<str:token>/", invitations.invited, name="invited"),
    path("races/<slug:slug>/invited/", invitations.race_invited, name="race_invited"),
    path("invitations/stop/<str:token>/", invitations.invited_stop, name="invited_stop"),
    path("seasons/", season_views.seasons, name="seasons"),
    path("seasons/new/", season_planning.season_new, name="season_new"),
    path("seasons/now/", season_views.season_now, name="season_now"),
    path("seasons/<slug:slug>/", season_views.season, name="season"),
    path("seasons/<slug:slug>/copy/", season_actions.season_copy, name="season_copy"),
    path("seasons/<slug:slug>/continues/", season_actions.season_continues, name="season_continues"),
    path("seasons/<slug:slug>/delete/", season_actions.season_delete, name="season_delete"),
    path("seasons/<slug:slug>/rules/", season_views.rules, name="season_rules"),
    path("seasons/<slug:slug>/calendar/", season_views.calendar, name="season_calendar"),
    path("seasons/<slug:slug>/calendar.ics", season_views.calendar_file, name="season_calendar_file"),
    path("seasons/<slug:slug>/racers/<str:alias>/", season_views.season_racer, name="season_racer"),
    path("hall-of-fame/", season_views.hall, name="hall"),
    path("seasons/<slug:slug>/standings/", standings.standings, name="season_standings"),
    re_path(
        r"^seasons/(?P<slug>[-\w]+)/standings\.(?P<form>json|csv|atom)$",
        standings.standings_file,
        name="standings_file",
    ),
    path("seasons/<slug:slug>/finales/", standings.fields, name="season_fields"),
    path("cups/", cups.cups, name="cups"),
    path("cups/starter/", cups.cup_starter, name="cup_starter"),
    path("cups/<str:day>/", cups.cup, name="cup"),
    path("notices/", notices.notices, name="notices"),
    path("notices/bell/", notices.notices_bell, name="notices_bell"),
    path("notices/read/", notices.notices_read, name="notices_read"),
    path("notices/stop/<str:token>/", notices.notices_stop, name="notices_stop"),
    path("notices/<int:pk>/", notices.notice_open, name="notice_open"),
    path("settings/notices/", notices.notice_settings, name="notice_settings"),
    path("settings/webhooks/", webhooks.webhooks, name="webhooks"),
    path("settings/webhooks/<int:pk>/remove/", webhooks.webhook_remove, name="webhook_remove"),
    path("settings/webhooks/<int:pk>/test/", webhooks.webhook_test, name="webhook_test"),
    path("settings/webhooks/<int:pk>/secret/", webhooks.webhook_secret, name="webhook_secret"),
]
