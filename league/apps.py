from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class LeagueConfig(AppConfig):
    name = "league"
    verbose_name = _("League")

    def ready(self) -> None:
        from accounts.quotas import register as register_quota
        from accounts.signals import account_taken_over
        from core.cards.registry import register_cards
        from core.events import register_reader
        from core.pages.registry import register_slots
        from races.boards.drawn_boards import register_cut
        from races.entries import eligibility, engines
        from races.rules import validation
        from races.signals import board_changed

        from . import spoilers
        from .cups.services import check_cup
        from .invitations import services as inviting
        from .notices.reader import NOTICES
        from .seasons import streams
        from .seasons.event_reader import SEASONS
        from .seasons.services.seasons import check_round_times, hold_season
        from .standings.selectors.boards import check_division, cut_shown, read_rounds
        from .stewarding.official_results import is_final, is_official
        from .stewarding.services import follow_board
        from .webhooks import deliveries  # noqa: F401 - its kind of job is known from the start
        from .webhooks.services import WEBHOOKS, drop_webhooks

        eligibility.CHECKS += [check_division, check_cup]
        eligibility.READERS.append(read_rounds)
        register_quota(inviting.INVITED_A_DAY)
        for reader in (NOTICES, WEBHOOKS, SEASONS):
            register_reader(reader)
        validation.TIME_CHECKS.append(check_round_times)
        streams.register()
        spoilers.register()
        register_cards(["league.cards.kinds"])
        validation.HOLDS.append(hold_season)
        engines.OFFICIAL_CHECKS.append(is_official)
        engines.FINAL_CHECKS.append(is_final)
        register_cut(cut_shown)
        register_slots(
            {
                "menu.account": "league/following/parts/menu.html",
                "head.notices": "league/notices/parts/bell.html",
                "settings.notices": "league/notices/parts/tab.html",
                "settings.webhooks": "league/webhooks/parts/tab.html",
                "race.crumb": "league/seasons/parts/race_crumb.html",
                "race.division": "league/seasons/parts/race_division.html",
                "race.organise": "league/invitations/parts/to_invited.html",
                "race.side": "league/seasons/parts/race_side.html",
                "race.cancelling": "league/seasons/parts/cancelling.html",
                "race.removing": "league/seasons/parts/removing.html",
                "board.moved": "league/standings/parts/qualifying_tag.html",
                "board.cut": "league/standings/parts/qualifying_line.html",
                "board.me": "league/standings/parts/qualifying_line_of_racer.html",
                "worth.conclusions": "league/standings/parts/qualifying_line_of_place.html",
                "duels.side": "league/standings/parts/duels_side.html",
            }
        )
        board_changed.connect(follow_board, dispatch_uid="league.follow_board")
        account_taken_over.connect(drop_webhooks, dispatch_uid="league.drop_webhooks")
