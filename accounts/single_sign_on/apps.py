from django.apps import AppConfig


class SingleSignOnConfig(AppConfig):
    name = "accounts.single_sign_on"

    def ready(self) -> None:
        from allauth.account.signals import user_logged_in
        from allauth.socialaccount import admin as provider_admin
        from allauth.socialaccount.models import SocialAccount, SocialApp, SocialToken

        from .receivers import mark_the_session

        user_logged_in.connect(mark_the_session, dispatch_uid="accounts.mark_the_session")
        # the provider is set in the environment, and no token is kept
        for model in (SocialAccount, SocialApp, SocialToken):
            if provider_admin.admin.site.is_registered(model):
                provider_admin.admin.site.unregister(model)
