"""Personal data of connections to a provider."""

from allauth.socialaccount.models import SocialAccount, SocialApp, SocialToken

from core.personal_data.rules import NOBODY, SECRET, PersonalData, register

register(
    "single_sign_on",
    PersonalData(SocialToken, owner="account__user", rows=True, withheld={SECRET: "*"}),
    PersonalData(
        SocialAccount,
        owner="user",
        rows=True,
        section="connections",
        exported="provider extra_data",
        withheld={SECRET: "uid"},
    ),
    PersonalData(SocialApp, kept={NOBODY: "provider provider_id name client_id secret key settings"}),
)
