"""Addresses of chats: what is posted to Discord and Slack is a message for people, in their own form."""

from __future__ import annotations

import json
import re
from urllib.parse import urlsplit

DISCORD, SLACK = "Discord", "Slack"
# Hosts of the addresses that they hand out (Discord: "Execute Webhook"; Slack: "Incoming webhooks").
HOSTS = {
    "discord.com": DISCORD,
    "discordapp.com": DISCORD,
    "ptb.discord.com": DISCORD,
    "canary.discord.com": DISCORD,
    "hooks.slack.com": SLACK,
    "hooks.slack-gov.com": SLACK,
}
MOST_DISCORD = 2000
_MARKS = re.compile(r"([\\*_~`|>#\[\]()<-])")


def chat_of(url: str) -> str | None:
    """Which chat an address belongs to; None for a program's."""
    parts = urlsplit(url)
    chat = HOSTS.get((parts.hostname or "").removesuffix("."))
    # Discord takes Slack's form at an address of its own
    return SLACK if chat == DISCORD and parts.path.rstrip("/").endswith("/slack") else chat


def message(chat: str, words: str, link: str) -> bytes:
    """The body that a chat takes. Whatever a racer or a race is called, it marks nothing up and calls nobody."""
    if chat == DISCORD:
        plain = _MARKS.sub(r"\\\1", words)
        return json.dumps({"content": f"{plain}\n{link}"[:MOST_DISCORD], "allowed_mentions": {"parse": []}}).encode()
    said = words.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return json.dumps({"text": f"{said}\n{link}"}).encode()
