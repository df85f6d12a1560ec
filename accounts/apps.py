from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class AccountsConfig(AppConfig):
    name = "accounts"
    verbose_name = _("Accounts")

    def ready(self) -> None:
        from allauth.account.signals import password_changed, password_reset
        from django.contrib.auth.signals import user_logged_in
        from django.db.models.signals import post_delete

        from core.pages.registry import register_slots

        from . import events  # noqa: F401 - its kinds of events are known from the start
        from .class_accounts.services import LEARNERS
        from .following import FOLLOWED
        from .models import Racer, TeamMember
        from .pictures.services import PICTURES, take_picture_along
        from .quotas import register as register_quota
        from .signing_in.receivers import keep_the_session, know_the_address, take_over_on_reset
        from .teams.services import lead_on_without
        from .usage.storage import register

        register(PICTURES)
        register_quota(LEARNERS)
        register_quota(FOLLOWED)
        post_delete.connect(take_picture_along, sender=Racer, dispatch_uid="accounts.take_picture_along")
        post_delete.connect(lead_on_without, sender=TeamMember, dispatch_uid="accounts.lead_on_without")
        for signal in (user_logged_in, password_changed, password_reset):
            signal.connect(know_the_address, dispatch_uid="accounts.know_the_address")
        password_reset.connect(take_over_on_reset, dispatch_uid="accounts.take_over_on_reset")
        user_logged_in.connect(keep_the_session, dispatch_uid="accounts.keep_the_session")
        register_slots({"head.account": "accounts/parts/head.html"})
