"""A small learning platform: keys, log-in, tokens and grade books over HTTP, with the checks of LTI 1.3 and AGS 2.0.

It knows nothing of the library that the site uses: tokens are made and read with PyJWT."""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any
from urllib.parse import parse_qs, urlsplit

import jwt
from cryptography.hazmat.primitives.asymmetric import rsa

CLAIM = "https://purl.imsglobal.org/spec/lti/claim/"
AGS = "https://purl.imsglobal.org/spec/lti-ags/"
LINE, SCORE = f"{AGS}scope/lineitem", f"{AGS}scope/score"
DEEP = "https://purl.imsglobal.org/spec/lti-dl/claim/"
ROLE = "http://purl.imsglobal.org/vocab/lis/v2/membership#"
ASSERTION = "urn:ietf:params:oauth:client-assertion-type:jwt-bearer"


def new_key() -> rsa.RSAPrivateKey:
    return rsa.generate_private_key(public_exponent=65537, key_size=2048)


@dataclass
class Platform:
    """State of the platform; ``tool_keys`` gives the tool's key set, ``redirects`` are the tool's launch addresses."""

    base: str = ""
    client_id: str = "paddock-1"
    deployment: str = "deployment-1"
    tool_keys: Callable[[], dict[str, Any]] = lambda: {"keys": []}
    redirects: list[str] = field(default_factory=list)
    scopes: tuple[str, ...] = (LINE, SCORE)
    key: rsa.RSAPrivateKey = field(default_factory=new_key)
    kid: str = "key-1"
    people: dict[str, tuple[str, str]] = field(default_factory=dict)  # sub: name, role
    lines: dict[str, dict[str, Any]] = field(default_factory=dict)
    scores: list[dict[str, Any]] = field(default_factory=list)
    tokens: dict[str, set[str]] = field(default_factory=dict)
    assertions: set[str] = field(default_factory=set)
    chosen: list[dict[str, Any]] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    fetched: int = 0
    broken: int = 0  # a status that every request for a score is answered with
    link: dict[str, str] = field(default_factory=dict)  # custom parameters of the link of the course page
    log_in_at: str = ""

    def jwks(self) -> dict[str, Any]:
        public = jwt.algorithms.RSAAlgorithm.to_jwk(self.key.public_key(), as_dict=True)
        return {"keys": [{**public, "kid": self.kid, "alg": "RS256", "use": "sig"}]}

    def claims(self, sub: str, nonce: str, /, **more: Any) -> dict[str, Any]:
        """The body of a resource link launch of this person."""
        name, role = self.people[sub]
        now = int(time.time())
        line = next(iter(self.lines.values()), {}).get("id")
        body = {
            "iss": self.base,
            "aud": self.client_id,
            "sub": sub,
            "exp": now + 300,
            "iat": now,
            "nonce": nonce,
            "name": name,
            "email": f"{sub}@example.edu",
            f"{CLAIM}deployment_id": self.deployment,
            f"{CLAIM}version": "1.3.0",
            f"{CLAIM}message_type": "LtiResourceLinkRequest",
            f"{CLAIM}target_link_uri": (self.redirects or [""])[0],
            f"{CLAIM}roles": [f"{ROLE}{role}"],
            f"{CLAIM}context": {"id": "course-7", "title": "Reinforcement learning"},
            f"{CLAIM}resource_link": {"id": "link-1"},
            f"{CLAIM}custom": self.link,
            f"{AGS}claim/endpoint": {
                "scope": list(self.scopes),
                "lineitems": f"{self.base}/lines?of=7",
                **({"lineitem": line} if line else {}),
            },
        }
        return {name: value for name, value in (body | more).items() if value is not None}

    def deep(self, sub: str, nonce: str, /, **settings: Any) -> dict[str, Any]:
        """The body of a request to choose a link."""
        asked = {
            "deep_link_return_url": f"{self.base}/chosen",
            "accept_types": ["ltiResourceLink"],
            "accept_presentation_document_targets": ["window"],
            "data": "of the form",
        }
        more = {f"{CLAIM}message_type": "LtiDeepLinkingRequest", f"{DEEP}deep_linking_settings": asked | settings}
        return self.claims(sub, nonce, **more, **{f"{CLAIM}resource_link": None, f"{AGS}claim/endpoint": None})

    def signed(self, body: dict[str, Any], **options: Any) -> str:
        options = {"algorithm": "RS256", "headers": {"kid": self.kid}, "key": self.key} | options
        return jwt.PyJWS().encode(json.dumps(body).encode(), options.pop("key"), **options)

    # --- what the tool signs

    def read(self, token: str, audience: str) -> dict[str, Any]:
        """What a token of the tool says. Raises jwt.InvalidTokenError."""
        kid = jwt.get_unverified_header(token).get("kid")
        known = [one for one in self.tool_keys()["keys"] if one["kid"] == kid]
        if not known:
            raise jwt.InvalidTokenError("unknown key")
        key = jwt.PyJWK(known[0], "RS256").key
        options = {"require": ["iss", "aud", "exp", "iat"]}
        found = jwt.decode(token, key, algorithms=["RS256"], audience=audience, options=options)
        if found["iss"] != self.client_id:
            raise jwt.InvalidTokenError("another issuer")
        return found

    def token(self, form: dict[str, str]) -> tuple[int, dict[str, Any]]:
        try:
            said = self.read(form.get("client_assertion", ""), f"{self.base}/token")
        except jwt.InvalidTokenError as error:
            self.refused.append(f"token: {error}")
            return 401, {"error": "invalid_client"}
        wanted = set(form.get("scope", "").split())
        fine = form.get("grant_type") == "client_credentials" and form.get("client_assertion_type") == ASSERTION
        if not fine or said.get("sub") != self.client_id or said["jti"] in self.assertions:
            return 400, {"error": "invalid_request"}
        if not wanted or wanted - set(self.scopes):
            return 400, {"error": "invalid_scope"}
        self.assertions.add(said["jti"])
        made = secrets.token_hex(8)
        self.tokens[made] = wanted
        return 200, {"access_token": made, "token_type": "Bearer", "expires_in": 3600, "scope": " ".join(wanted)}

    def score(self, number: str, sent: dict[str, Any]) -> int:
        """Take a score. Answers 409 to one that is not newer than what is known of the person."""
        if self.broken:
            return self.broken
        if sent["userId"] not in self.people or number not in self.lines:
            return 404
        at = datetime.fromisoformat(sent["timestamp"])
        mine = [one for one in self.scores if (one["line"], one["userId"]) == (number, sent["userId"])]
        if at.tzinfo is None or any(datetime.fromisoformat(one["timestamp"]) >= at for one in mine):
            return 409
        self.scores.append({**sent, "line": number})
        return 200


class _Handler(BaseHTTPRequestHandler):
    platform: Platform

    def log_message(self, *args: Any) -> None:
        pass

    def _answer(self, status: int, body: Any = None, kind: str = "application/json") -> None:
        sent = b"" if body is None else (body if isinstance(body, str) else json.dumps(body)).encode()
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(sent)))
        self.end_headers()
        self.wfile.write(sent)

    def _may(self, scope: str) -> bool:
        token = self.headers.get("Authorization", "").removeprefix("Bearer ")
        fine = scope in self.platform.tokens.get(token, ())
        if not fine:
            self.platform.refused.append(f"{self.path}: no {scope}")
            self._answer(403, {"error": "scope"})
        return fine

    def do_GET(self) -> None:
        parts, platform = urlsplit(self.path), self.platform
        asked = {name: values[0] for name, values in parse_qs(parts.query).items()}
        if parts.path == "/jwks":
            platform.fetched += 1
            self._answer(200, platform.jwks())
        elif parts.path == "/authorize":
            self._authorize(asked)
        elif parts.path == "/course":
            self._answer(200, _course(platform, asked["as"]), "text/html; charset=utf-8")
        elif parts.path == "/lines" and self._may(LINE):
            wanted = asked.get("resource_id")
            self._answer(200, [one for one in platform.lines.values() if wanted in (None, one.get("resourceId"))])
        elif parts.path != "/lines":
            self._answer(404)

    def do_POST(self) -> None:
        parts, platform = urlsplit(self.path), self.platform
        body = self.rfile.read(int(self.headers["Content-Length"]))
        kind = self.headers["Content-Type"]
        form = {name: values[0] for name, values in parse_qs(body.decode()).items()}
        if parts.path == "/token":
            self._answer(*platform.token(form))
        elif parts.path == "/chosen":
            platform.chosen.append(platform.read(form["JWT"], platform.base))
            self._answer(200, "<h1>Chosen</h1>", "text/html; charset=utf-8")
        elif parts.path == "/lines" and kind == "application/vnd.ims.lis.v2.lineitem+json":
            if self._may(LINE):
                number = str(len(platform.lines) + 1)
                platform.lines[number] = json.loads(body) | {"id": f"{platform.base}/lines/{number}/line?of=7"}
                self._answer(201, platform.lines[number])
        elif parts.path.endswith("/scores") and kind == "application/vnd.ims.lis.v1.score+json":
            if self._may(SCORE):
                self._answer(platform.score(parts.path.split("/")[2], json.loads(body)))
        else:
            self._answer(404)

    def _authorize(self, asked: dict[str, str]) -> None:
        platform = self.platform
        wanted = {"response_type": "id_token", "response_mode": "form_post", "scope": "openid", "prompt": "none"}
        fine = {**asked, **wanted} == asked and asked.get("client_id") == platform.client_id
        if not fine or asked.get("redirect_uri") not in platform.redirects or not asked.get("nonce"):
            self._answer(400, asked)
            return
        make = platform.deep if asked.get("lti_message_hint") == "choose" else platform.claims
        token = platform.signed(make(asked["login_hint"], asked["nonce"]))
        fields = {"id_token": token, "state": asked["state"]}
        self._answer(200, _form(asked["redirect_uri"], fields, sends_itself=True), "text/html; charset=utf-8")


def _form(
    action: str, fields: dict[str, str], *, sends_itself: bool = False, label: str = "Go", target: str = ""
) -> str:
    inputs = "".join(f'<input type=hidden name="{name}" value="{escape(value)}">' for name, value in fields.items())
    script = "<script>document.forms[0].submit()</script>" if sends_itself else ""
    return f'<form method=post action="{action}" target="{target}">{inputs}<button>{label}</button></form>{script}'


def _course(platform: Platform, sub: str) -> str:
    """The page of the course, with the tool's link in a frame as platforms show it, and one in a new window."""
    common = {"iss": platform.base, "login_hint": sub, "client_id": platform.client_id}
    link = common | {"target_link_uri": platform.redirects[0], "lti_message_hint": "link"}
    choose = common | {
        "target_link_uri": platform.redirects[0].replace("/launch/", "/choose/"),
        "lti_message_hint": "choose",
    }
    at = platform.log_in_at
    return (
        f"<!doctype html><h1>Course</h1>{_form(at, link, label='Open here', target='inside')}"
        f"{_form(at, link, label='Open', target='_self')}{_form(at, choose, label='Choose', target='inside')}"
        "<iframe name=inside width=900 height=600></iframe>"
    )


@contextmanager
def running_platform(**state: Any) -> Iterator[Platform]:
    """A platform on a free port of this machine."""
    platform = Platform(**state)
    server = ThreadingHTTPServer(("127.0.0.1", 0), type("Handler", (_Handler,), {"platform": platform}))
    platform.base = f"http://127.0.0.1:{server.server_port}"
    thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield platform
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
