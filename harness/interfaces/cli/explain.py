"""`crosscheck explain`: what a message code means, and what to do."""

import argparse
import shutil
import sys

from physics_crosscheck.harness.results.messages import (
    code_lines,
    find_code,
    list_lines,
    search_codes,
    similar_codes,
)
from physics_crosscheck.harness.results.visible import visible
from .exit_codes import AGREE, USAGE


def main(options: argparse.Namespace) -> int:
    """Print the page of each code, or list those with all other words; without any, list all."""
    width = min(shutil.get_terminal_size().columns, 100)
    if not options.codes:
        print("\n".join(list_lines(width)))
        return AGREE
    wanted = {word: find_code(word) for word in options.codes}
    unknown = [word for word, found in wanted.items() if found is None]
    known_codes = [found for found in wanted.values() if found is not None]
    print(
        "\n\n".join("\n".join(code_lines(one, width)) for one in known_codes),
        end="\n" * bool(known_codes),
    )
    if unknown and not known_codes and (matching := search_codes(unknown)):
        print("\n".join(list_lines(width, matching)))
        return AGREE
    for word in unknown:
        similar = similar_codes(word)
        hint = (
            f"did you mean {' or '.join(similar[:2])}?"
            if similar
            else "`crosscheck explain` lists all"
        )
        print(
            f"crosscheck: no message has the code or text {visible(word)}; {hint}", file=sys.stderr
        )
    return USAGE if unknown else AGREE
