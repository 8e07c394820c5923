"""What the site makes of the pages: a link to a file beside `docs/` is its name there."""

from __future__ import annotations

import re
from typing import Any

_OUTSIDE = re.compile(r"\[([^\]]+)\]\((?:\.\./)+(?!how-to|decisions|schema|cases)[^)\s]*\)")
_OUTSIDE_NESTED = re.compile(r"\[([^\]]+)\]\((?:\.\./){2,}[^)\s]*\)")


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Take away links that leave the pages; within a folder of `docs/`, one step up stays."""
    if "/" in page.file.src_path:
        return _OUTSIDE_NESTED.sub(r"\1", markdown)
    return _OUTSIDE.sub(r"\1", markdown)
