"""What a platform must know of this site: addresses for people who enter them, and a file for Canvas."""

from django.http import HttpRequest
from django.urls import reverse
from django.utils.translation import gettext as _

from core.addresses import origin_of

from .scores import LINE
from .services import SCORE


def tool_addresses(request: HttpRequest) -> list[tuple[str, str]]:
    """Labels and values for the forms of platforms."""
    named = {
        _("Tool URL, target link URI, redirect URI"): "lti_launch",
        _("Initiate login URL, OpenID Connect initiation URL"): "lti_log_in",
        _("Public keyset URL"): "lti_keys",
        _("Content selection URL (deep linking)"): "lti_choose",
        _("Configuration as JSON (Canvas)"): "lti_tool",
    }
    return [(label, f"{origin_of(request)}{reverse(name)}") for label, name in named.items()]


def tool_configuration(request: HttpRequest) -> dict[str, object]:
    """The configuration that Canvas imports from an address."""
    origin = origin_of(request)
    launch, choose = f"{origin}{reverse('lti_launch')}", f"{origin}{reverse('lti_choose')}"
    choice = {"message_type": "LtiDeepLinkingRequest", "target_link_uri": choose}
    placements = [
        {"placement": "assignment_selection", **choice},
        {"placement": "link_selection", **choice},
        {
            "placement": "course_navigation",
            "message_type": "LtiResourceLinkRequest",
            "target_link_uri": launch,
            "windowTarget": "_blank",
        },
    ]
    return {
        "title": "Paddock",
        "description": _("Racing of cars trained by reinforcement learning"),
        "target_link_uri": launch,
        "oidc_initiation_url": f"{origin}{reverse('lti_log_in')}",
        "redirect_uris": [launch],
        "public_jwk_url": f"{origin}{reverse('lti_keys')}",
        "scopes": [LINE, SCORE],
        "custom_fields": {},
        "extensions": [
            {
                "platform": "canvas.instructure.com",
                "privacy_level": "name_only",
                "settings": {"text": "Paddock", "placements": placements},
            }
        ],
    }
