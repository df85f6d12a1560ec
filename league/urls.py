"""Addresses of the league's pages."""

from django.urls import path, re_path

from .views import cups, following, home, inviting, notices, organising, racers, season_actions, seasons, webhooks

urlpatterns = [
    path("", home.home, name="home"),
    path("racers/<str:alias>/", racers.racer, name="racer"),
    path("racers/<str:alias>/follow/", following.follow, name="follow"),
    path("racers/<str:alias>/unfollow/", following.unfollow, name="unfollow"),
    path("following/", following.following, name="following"),
    path("races/invited/<str:token>/", inviting.invited, name="invited"),
    path("races/<slug:slug>/invited/", inviting.race_invited, name="race_invited"),
    path("invitations/stop/<str:token>/", inviting.invited_stop, name="invited_stop"),
    path("seasons/", seasons.seasons, name="seasons"),
    path("seasons/new/", organising.season_new, name="season_new"),
    path("seasons/now/", seasons.season_now, name="season_now"),
    path("seasons/<slug:slug>/", seasons.season, name="season"),
    path("seasons/<slug:slug>/copy/", season_actions.season_copy, name="season_copy"),
    path("seasons/<slug:slug>/continues/", season_actions.season_continues, name="season_continues"),
    path("seasons/<slug:slug>/delete/", season_actions.season_delete, name="season_delete"),
    path("seasons/<slug:slug>/standings/", seasons.standings, name="season_standings"),
    re_path(
        r"^seasons/(?P<slug>[-\w]+)/standings\.(?P<form>json|csv|atom)$", seasons.standings_file, name="standings_file"
    ),
    path("seasons/<slug:slug>/finales/", seasons.fields, name="season_fields"),
    path("seasons/<slug:slug>/rules/", seasons.rules, name="season_rules"),
    path("seasons/<slug:slug>/calendar/", seasons.calendar, name="season_calendar"),
    path("seasons/<slug:slug>/calendar.ics", seasons.calendar_file, name="season_calendar_file"),
    path("seasons/<slug:slug>/racers/<str:alias>/", seasons.season_racer, name="season_racer"),
    path("cups/", cups.cups, name="cups"),
    path("cups/starter/", cups.cup_starter, name="cup_starter"),
    path("cups/<str:day>/", cups.cup, name="cup"),
    path("hall-of-fame/", seasons.hall, name="hall"),
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
