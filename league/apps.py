from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class LeagueConfig(AppConfig):
    name = "league"
    verbose_name = _("League")

    def ready(self) -> None:
        from accounts.quotas import register as register_quota
        from accounts.signals import account_taken_over
        from core.events import register_reader
        from core.pages import register_slots
        from races.cuts import register_cut
        from races.eligibility import register
        from races.engines import register_final, register_official
        from races.signals import board_changed
        from races.validation import register_hold, register_time_check

        from . import spoilers, streams
        from .eligibility import check_division
        from .receivers import drop_webhooks, follow_board
        from .selectors.boards import cut_shown
        from .services import deliveries, inviting, mails  # noqa: F401 - their kinds of jobs are known from the start
        from .services.closing import is_final, is_official
        from .services.cups import check_cup
        from .services.follow import SEASONS
        from .services.news import NOTICES
        from .services.seasons import check_round_times, hold_season
        from .services.webhooks import WEBHOOKS

        register(check_division)
        register_quota(inviting.INVITED_A_DAY)
        register(check_cup)
        for reader in (NOTICES, WEBHOOKS, SEASONS):
            register_reader(reader)
        register_time_check(check_round_times)
        streams.register()
        spoilers.register()
        register_hold(hold_season)
        register_official(is_official)
        register_final(is_final)
        register_cut(cut_shown)
        register_slots(
            {
                "menu.account": "league/parts/menu_following.html",
                "head.notices": "league/parts/bell.html",
                "settings.notices": "league/parts/tab_notices.html",
                "settings.webhooks": "league/parts/tab_webhooks.html",
                "race.crumb": "league/parts/race_crumb.html",
                "race.division": "league/parts/race_division.html",
                "race.organise": "league/parts/to_invited.html",
                "race.side": "league/parts/race_side.html",
                "race.cancelling": "league/parts/cancelling.html",
                "race.removing": "league/parts/removing.html",
                "board.moved": "league/parts/cut_tag.html",
                "board.cut": "league/parts/cut.html",
                "board.me": "league/parts/cut_of_me.html",
                "worth.said": "league/parts/cut_of_place.html",
                "duels.side": "league/parts/duels_side.html",
            }
        )
        board_changed.connect(follow_board, dispatch_uid="league.follow_board")
        account_taken_over.connect(drop_webhooks, dispatch_uid="league.drop_webhooks")
