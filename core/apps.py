from django.apps import AppConfig
from django.db.models.signals import post_migrate
from django.utils.translation import gettext_lazy as _


class CoreConfig(AppConfig):
    name = "core"
    verbose_name = _("Core")

    def ready(self) -> None:
        from .audit.admin_site import copy_admin_log
        from .audit.triggers import installed_after_migrate

        copy_admin_log()
        post_migrate.connect(installed_after_migrate, sender=self, dispatch_uid="core.audit.triggers")
