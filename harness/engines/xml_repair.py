"""XML text without errors that a strict parser rejects and engines ignore.

MuJoCo 4.0.0 and PyBullet 3.2.7, whose parsers are of one family (TinyXML-2), accept blank lines
before the declaration, a byte order mark, Latin-1 (whatever is declared), two hyphens in a comment,
and a zero byte at the end.
"""

from __future__ import annotations

import re

_HEAD = re.compile(rb"\s*<\?xml.*?\?>", re.DOTALL)
_ENCODING = re.compile(rb"encoding\s*=\s*[\"']([\w.-]+)[\"']")
_HIDDEN = re.compile(rb"<!\[CDATA\[.*?\]\]>|<!--.*?-->", re.DOTALL)
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
"""First bytes of UTF-16 text, which no engine reads."""


def repaired_xml(data: bytes) -> bytes:
    """Return the file as UTF-8, with the content on its original lines."""
    plain = _decoded(data).encode("utf-8").rstrip(b"\0 \t\r\n") + b"\n"
    if head := _HEAD.match(plain):
        plain = _blank(head[0]) + plain[head.end() :]
    return _HIDDEN.sub(lambda m: m[0] if m[0].startswith(b"<![") else _blank(m[0]), plain)


def _decoded(data: bytes) -> str:
    """Return the text; undecodable bytes become distinct characters, so that names differ."""
    if data.startswith(UTF_16):
        return data.decode("utf-16", errors="replace")
    head = _HEAD.match(data)
    declared = _ENCODING.search(head[0]) if head else None
    for encoding in ("utf-8-sig", declared[1].decode("ascii") if declared else "utf-8"):
        try:
            return data.decode(encoding)
        except (UnicodeError, LookupError):
            continue
    return data.decode("latin-1")


def _blank(text: bytes) -> bytes:
    return re.sub(rb"[^\r\n]", b" ", text)
