"""Requests whose length or lines can be read in two ways. Behind each stands a second request."""

from __future__ import annotations

HOST = b"Host: 127.0.0.1\r\n"
CHUNKED = b"POST /api/length HTTP/1.1\r\n" + HOST + b"Transfer-Encoding: chunked\r\n\r\n"
DONE = b"0\r\n\r\n"


def get(*lines: bytes, start: bytes = b"GET {path} HTTP/1.1", host: bytes = HOST, body: bytes = b"") -> bytes:
    return start + b"\r\n" + host + b"".join(line + b"\r\n" for line in lines) + b"\r\n" + body


# With "{path}" for an address that the server answers
HEADS: dict[str, bytes] = {
    "both lengths": get(b"Content-Length: 5", b"Transfer-Encoding: chunked", body=DONE),
    "both lengths, the other way": get(b"Transfer-Encoding: chunked", b"Content-Length: 5", body=DONE),
    "both lengths, of nothing": get(b"Content-Length: 0", b"Transfer-Encoding: chunked", body=DONE),
    "two lengths": get(b"Content-Length: 5", b"Content-Length: 6", body=b"hello"),
    "two equal lengths": get(b"Content-Length: 5", b"content-length: 5", body=b"hello"),
    "a list of lengths": get(b"Content-Length: 5, 5", body=b"hello"),
    "a signed length": get(b"Content-Length: +5", body=b"hello"),
    "a negative length": get(b"Content-Length: -5"),
    "a length with an underscore": get(b"Content-Length: 1_0", body=b"0123456789"),
    "a length in hexadecimal": get(b"Content-Length: 0x5", body=b"hello"),
    "an empty length": get(b"Content-Length:"),
    "a length of 5,000 digits": get(b"Content-Length: " + b"9" * 5000),
    "a length in Arabic digits": get("Content-Length: \u0665".encode()),
    "two encodings": get(b"Transfer-Encoding: chunked", b"Transfer-Encoding: chunked", body=DONE),
    "an encoding and none": get(b"Transfer-Encoding: chunked", b"Transfer-Encoding: identity", body=DONE),
    "a list of encodings": get(b"Transfer-Encoding: gzip, chunked", body=DONE),
    "chunked twice": get(b"Transfer-Encoding: chunked, chunked", body=DONE),
    "xchunked": get(b"Transfer-Encoding: xchunked", body=DONE),
    "identity": get(b"Transfer-Encoding: identity"),
    "no encoding": get(b"Transfer-Encoding:"),
    "a comma before it": get(b"Transfer-Encoding: , chunked", body=DONE),
    "a parameter": get(b"Transfer-Encoding: chunked;q=1", body=DONE),
    "quoted": get(b'Transfer-Encoding: "chunked"', body=DONE),
    "a vertical tab": get(b"Transfer-Encoding: \x0bchunked", body=DONE),
    "a no-break space": get(b"Transfer-Encoding: \xa0chunked", body=DONE),
    "chunked in HTTP/1.0": get(b"Transfer-Encoding: chunked", start=b"POST {path} HTTP/1.0", body=DONE),
    "chunked in HTTP/1.0, kept alive": get(
        b"Transfer-Encoding: chunked", b"Connection: keep-alive", start=b"POST {path} HTTP/1.0", body=DONE
    ),
    "a folded line": get(b"X-Long: a", b" b"),
    "a folded line with a tab": get(b"X-Long: a", b"\tb"),
    "a folded length": get(b"Content-Length:", b" 5", body=b"hello"),
    "a folded encoding": get(b"Transfer-Encoding:", b" chunked", body=DONE),
    "a fold behind the request line": get(start=b"GET {path} HTTP/1.1\r\n X: y"),
    "bare LF": b"GET {path} HTTP/1.1\nHost: 127.0.0.1\n\n",
    "one bare LF": get(b"X: a\nTransfer-Encoding: chunked"),
    "a bare LF at the end": b"GET {path} HTTP/1.1\r\n" + HOST + b"\n",
    "a bare CR": get(b"X: a\rTransfer-Encoding: chunked"),
    "a bare CR in the request line": get(start=b"GET {path} HTTP/1.1\r"),
    "CR CR LF": b"GET {path} HTTP/1.1\r\r\n" + HOST + b"\r\n",
    "a space before the colon": get(b"Transfer-Encoding : chunked", body=DONE),
    "a tab before the colon": get(b"Content-Length\t: 5", body=b"hello"),
    "no colon": get(b"Transfer-Encoding chunked"),
    "no name": get(b": value"),
    "a name with a NUL": get(b"X\x00Y: 1"),
    "a name with a slash": get(b"X/Y: 1"),
    "a name beyond ASCII": get("Té: 1".encode()),
    "a value with a NUL": get(b"X: a\x00b"),
    "a value with an escape": get(b"X: a\x1bb"),
    "two hosts": get(b"Host: elsewhere.example.org"),
    "no host": get(host=b""),
    "a space before the method": b" " + get(),
    "a bare LF before the method": b"\n" + get(),
    "two spaces": get(start=b"GET  {path} HTTP/1.1"),
    "a tab in the request line": get(start=b"GET\t{path} HTTP/1.1"),
    "a space behind the version": get(start=b"GET {path} HTTP/1.1 "),
    "no version": get(start=b"GET {path}"),
    "version 1.2": get(start=b"GET {path} HTTP/1.2"),
    "version 2.0": get(start=b"GET {path} HTTP/2.0"),
    "version 1.10": get(start=b"GET {path} HTTP/1.10"),
    "a small method": get(start=b"get {path} HTTP/1.1"),
    "a method with a colon": get(start=b"GE:T {path} HTTP/1.1"),
    "TLS": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(32),
}
CHUNKS: dict[str, bytes] = {
    "a huge extension": b"5;a=" + b"b" * 100_000 + b"\r\nhello\r\n" + DONE,
    "an extension without end": b"5;a=" + b"b" * 100_000,
    "many extensions": b"1;aaaaaaaa=bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb\r\nx\r\n" * 200
    + DONE,
    "an extension with a bare LF": b"5;a=b\nc\r\nhello\r\n" + DONE,
    "an extension that ends with a bare LF": b"5;a\n\r\nhello\r\n" + DONE,
    "an extension with a bare CR": b"5;a\rb\r\nhello\r\n" + DONE,
    "an extension with a NUL": b"5;a\x00\r\nhello\r\n" + DONE,
    "an extension without a name": b"5;\r\nhello\r\n" + DONE,
    "an extension with an open quote": b'5;a="b\r\nhello\r\n' + DONE,
    "a size with a plus": b"+5\r\nhello\r\n" + DONE,
    "a size with a minus": b"-5\r\nhello\r\n" + DONE,
    "a size with an underscore": b"0_5\r\nhello\r\n" + DONE,
    "a size with 0x": b"0x5\r\nhello\r\n" + DONE,
    "a size with a space before it": b" 5\r\nhello\r\n" + DONE,
    "a size with a space behind it": b"5 \r\nhello\r\n" + DONE,
    "a size with a bare LF": b"5\n\r\nhello\r\n" + DONE,
    "a size of 5,000 digits": b"0" * 5000 + b"5\r\nhello\r\n" + DONE,
    "a size beyond 64 bits": b"10000000000000005\r\nhello\r\n" + DONE,
    "no size": b"\r\nhello\r\n" + DONE,
    "an empty line before the size": b"\r\n5\r\nhello\r\n" + DONE,
    "a size that ends with LF": b"5\nhello\n0\n\n",
    "data that ends with LF": b"5\r\nhello\n" + DONE,
    "more data than told": b"5\r\nhello!\r\n" + DONE,
    "less data than told": b"6\r\nhello\r\n" + DONE,
    "a trailer": b"5\r\nhello\r\n0\r\nX-Trailer: 1\r\n\r\n",
    "a trailer with a length": b"5\r\nhello\r\n0\r\nContent-Length: 5\r\n\r\n",
    "a trailer without end": b"5\r\nhello\r\n0\r\nX: " + b"y" * 100_000,
    "a last chunk that ends with LF": b"5\r\nhello\r\n0\r\n\n",
}
FINE: dict[str, tuple[bytes, bytes]] = {
    "one chunk": (b"5\r\nhello\r\n" + DONE, b"5"),
    "several chunks": (b"5\r\nhello\r\n0A\r\n0123456789\r\n" + DONE, b"15"),
    "leading zeros": (b"0005\r\nhello\r\n000\r\n\r\n", b"5"),
    "a short extension": (b"5;name=value\r\nhello\r\n0;last\r\n\r\n", b"5"),
    "a quoted extension": (b'5;name="a b";other\r\nhello\r\n' + DONE, b"5"),
    "nothing": (DONE, b"0"),
}
