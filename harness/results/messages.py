"""Pages of the message codes: for a terminal, and as Markdown for the site."""

import difflib
import re
import textwrap
from collections.abc import Iterable, Iterator

from physics_crosscheck.harness.records.codes import GROUPS, Code, codes

_INDEX = """# Messages

This page is for users who see a code such as XC104. Afterwards you know its cause and remedy.
`crosscheck explain XC104` prints the same in a terminal. A code never changes its meaning.
"""


def find_code(word: str) -> Code | None:
    """Return the message of a code or name in any case; None for an unknown one."""
    return codes().get(word.upper()) or next(
        (one for one in codes().values() if one.name == word.lower()), None
    )


def search_codes(words: Iterable[str]) -> list[Code]:
    """Return all messages with all words, then others with most of them, ten at least.

    A word counts where it begins a word of the texts; one in the title ranks before the others.
    """
    starts = [re.compile(rf"\b{re.escape(word)}", re.IGNORECASE) for word in words]

    def matches(code: Code) -> tuple[int, ...]:
        title = f"{code.code} {code.name} {code.title}"
        texts = f"{title} {code.cause} {code.remedy}", title
        return tuple(sum(bool(start.search(text)) for start in starts) for text in texts)

    ranked = sorted(codes().values(), key=matches, reverse=True)
    counts = [matches(code)[0] for code in ranked]
    return ranked[: max(counts.count(len(starts)), min(len(counts) - counts.count(0), 10))]


def with_code(code: str, text: str) -> str:
    """Put a message's code in front of it, if it has one."""
    return f"{code} {text}" if code else text


def explain_hint(codes: Iterable[str]) -> str:
    """Return the last line of an output with messages; empty if none has a code."""
    first = next(filter(None, codes), "")
    return f"Explain a code: crosscheck explain {first}" if first else ""


def similar_codes(word: str) -> list[str]:
    """Return codes and names similar to a misspelled word, closest first."""
    names = difflib.get_close_matches(word.lower(), [one.name for one in codes().values()])
    return [*difflib.get_close_matches(word.upper(), codes()), *names]


def code_page(code: Code) -> str:
    """Return the page of a message as Markdown."""
    return (
        f"# {code.code}: {code.name}\n\n{code.title}\n\n## Meaning\n\n{code.cause}\n\n"
        f"## Example\n\n```text\n{code.example}\n```\n\n## What to do\n\n{code.remedy}\n"
    )


def index_page() -> str:
    """Return the page that lists all messages, by group."""
    parts = [_INDEX]
    for prefix, title in GROUPS.items():
        group = [one for one in codes().values() if one.code.startswith(prefix)]
        rows = (f"| [{one.code}]({one.code}.md) | {one.name} | {one.title} |\n" for one in group)
        parts.append(f"\n## {title}\n\n| code | name | meaning |\n|---|---|---|\n{''.join(rows)}")
    return "".join(parts)


def pages() -> dict[str, str]:
    """Return every page by the name of its file."""
    return {
        "index.md": index_page(),
        **{f"{one.code}.md": code_page(one) for one in codes().values()},
    }


def code_lines(code: Code, width: int) -> Iterator[str]:
    """Yield the page of a message for a terminal of the given width in columns."""
    title = f"{code.code} {code.name}: {code.title}"
    yield from textwrap.wrap(title, max(width, 20), subsequent_indent="  ", break_long_words=False)
    for title, text in (("Meaning", code.cause), ("Example", ""), ("What to do", code.remedy)):
        yield f"\n{title}"
        lines = [text] if text else code.example.splitlines()
        yield from (part for line in lines for part in _wrapped(line, width))


def _wrapped(line: str, width: int) -> list[str]:
    """Return a line in parts of the width, indented; its words and indentation stay whole."""
    begin = " " * (2 + len(line) - len(line.lstrip()))
    parts = textwrap.wrap(
        line.strip(), max(width, 20), initial_indent=begin, subsequent_indent=begin,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
    return parts or [""]


def list_lines(width: int, chosen: Iterable[Code] | None = None) -> Iterator[str]:
    """Yield the codes, by default all, with their titles, by group, in lines of a width."""
    rows = list(codes().values() if chosen is None else chosen)
    for prefix, title in GROUPS.items():
        group = [code for code in rows if code.code.startswith(prefix)]
        if group:
            yield f"{title} ({prefix}xx)"
        for code in group:
            yield from textwrap.wrap(
                f"{code.code}  {code.title}", max(width, 40), initial_indent="  ",
                subsequent_indent=" " * 9,
            )  # fmt: skip
