"""A mail server that speaks SMTP on a port of this machine, and answers as a test says."""

from __future__ import annotations

import socketserver
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from email import message_from_bytes
from email.message import Message

from django.test import override_settings

SMTP = "django.core.mail.backends.smtp.EmailBackend"


@dataclass
class MailServer:
    """``answers``: what a recipient (or a verb) is answered in place of 250, e.g. ``{"bob@example.org": "550 No"}``;
    ``at_most``: mails of one connection, then it is closed without a word; ``connections``: how many there were."""

    port: int = 0
    answers: dict[str, str] = field(default_factory=dict)
    at_most: int = 1000
    connections: int = 0
    arrived: list[tuple[str, Message]] = field(default_factory=list)

    @property
    def recipients(self) -> list[str]:
        return [to for to, _message in self.arrived]


class _Handler(socketserver.StreamRequestHandler):
    def handle(self) -> None:
        said: MailServer = self.server.said  # type: ignore[attr-defined]
        said.connections += 1
        self._say(said.answers.get("HELLO", "220 mail.example.org"))
        to, mails = "", 0
        while line := self.rfile.readline():
            words = line.decode().strip()
            verb = words.split(" ")[0].upper()
            if verb == "RCPT":
                to = words.partition("<")[2].partition(">")[0]
                self._say(said.answers.get(to, "250 OK"))
            elif verb == "DATA" and "DATA" not in said.answers:
                self._say("354 Go on")
                content = b"".join(iter(self.rfile.readline, b".\r\n"))
                if mails >= said.at_most:
                    return
                mails += 1
                said.arrived.append((to, message_from_bytes(content)))
                self._say("250 Taken")
            elif verb == "EHLO":
                self._say(said.answers.get(verb, "250-mail.example.org\r\n250 STARTTLS"))
            else:
                self._say(said.answers.get(verb, "221 Bye" if verb == "QUIT" else "250 OK"))
            if verb == "QUIT":
                return

    def _say(self, answer: str) -> None:
        self.wfile.write(answer.encode() + b"\r\n")


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = daemon_threads = True


@contextmanager
def mail_server(*, tls: bool = False) -> Iterator[MailServer]:
    """A server to which the site's mails go. ``tls``: the site asks for it, and no handshake succeeds."""
    said = MailServer()
    with _Server(("127.0.0.1", 0), _Handler) as server:
        server.said = said  # type: ignore[attr-defined]
        said.port = server.server_address[1]
        thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
        thread.start()
        with override_settings(
            EMAIL_BACKEND=SMTP, EMAIL_HOST="127.0.0.1", EMAIL_PORT=said.port, EMAIL_USE_TLS=tls, EMAIL_TIMEOUT=5
        ):
            yield said
        server.shutdown()
        thread.join()
