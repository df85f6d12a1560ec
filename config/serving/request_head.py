"""The form that the head of a request must have (RFC 9112), the same for the web server and the streams.

Whatever a proxy and a server could read in two ways (request smuggling) is refused: two lengths, folded lines, a bare
CR or LF, names and versions of another form.
"""

import re

_TOKEN = rb"[!#$%&'*+\-.^_`|~0-9A-Za-z]+"
_REQUEST_LINE = re.compile(rb"[!#$%&'*+\-.^_`|~0-9A-Z]+ [^\x00-\x20\x7f]+ HTTP/1\.([01])")
_FIELD = re.compile(rb"(" + _TOKEN + rb"):([\t\x20-\x7e\x80-\xff]*)")
_BARE = re.compile(rb"(?<!\r)\n|\r(?!\n|\Z)")
_BEGINS_BADLY = re.compile(rb"(?:\r\n)*[^!-~\r]")
_LENGTH = re.compile(rb"[0-9]{1,18}")
END = b"\r\n\r\n"


def is_malformed(received: bytes, new: int = 0) -> bool:
    """Whether the beginning of a head already cannot become one. ``new``: the first byte not checked before."""
    end = received.find(END)
    stop = len(received) if end < 0 else end + len(END)
    return bool(_BEGINS_BADLY.match(received) or _BARE.search(received, max(new - 1, 0), stop))


def head_fault(head: bytes) -> str | None:
    """What is wrong with a whole head; None when it is well-formed."""
    start, *lines = head.removesuffix(END).removesuffix(b"\r\n").split(b"\r\n")
    begun = _REQUEST_LINE.fullmatch(start)
    if begun is None:
        return "The request line is malformed."
    fields: dict[bytes, list[bytes]] = {}
    for line in lines:
        field = _FIELD.fullmatch(line)
        if field is None:
            return "A header line is folded." if line[:1] in (b" ", b"\t") else "A header line is malformed."
        fields.setdefault(field[1].lower(), []).append(field[2].strip(b" \t"))
    lengths, encodings = fields.get(b"content-length", []), fields.get(b"transfer-encoding", [])
    if len(lengths) + len(encodings) > 1:
        return "The length of the body is given more than once."
    if lengths and not _LENGTH.fullmatch(lengths[0]):
        return "Content-Length is not a number."
    if encodings and (begun[1] == b"0" or encodings[0].lower() != b"chunked"):
        return "This Transfer-Encoding is not supported."
    hosts = len(fields.get(b"host", []))
    if hosts > 1 or (hosts == 0 and begun[1] == b"1"):
        return "A request has exactly one Host."
    return None


def announces_body(head: bytes) -> bool:
    """Whether a well-formed head is followed by a body."""
    return re.search(rb"\r\n(?:transfer-encoding:|content-length:[ \t]*0*[1-9])", head, re.IGNORECASE) is not None
