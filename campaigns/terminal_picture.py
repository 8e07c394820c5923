"""The output of `crosscheck run` as a picture: RESULTS WIDTH OUT.svg.

    crosscheck run my_folder --out reports
    python -m campaigns.terminal_picture reports/results.json 80 docs/terminal.svg

The documentation uses `--light`: dark letters on white.
"""

from __future__ import annotations

import argparse
import io
import re
import sys
from pathlib import Path

from rich._export_format import CONSOLE_SVG_FORMAT
from rich.console import Console
from rich.terminal_theme import DEFAULT_TERMINAL_THEME, DIMMED_MONOKAI
from rich.text import Text

from physics_crosscheck.harness.records.read import read_results
from physics_crosscheck.harness.render.terminal.table import print_results

_FACES = re.compile(r"@font-face \{\{.*?\}\}", re.DOTALL)


def main(arguments: list[str]) -> int:
    """Write the picture; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path)
    parser.add_argument("width", type=int)
    parser.add_argument("out", type=Path)
    parser.add_argument("--light", action="store_true", help="dark letters on white")
    parser.add_argument(
        "--command", default="run", help="arguments of crosscheck in the picture [run]"
    )
    parser.add_argument("--report", type=Path, default=Path("reports/index.html"))
    options = parser.parse_args(arguments)
    results = read_results(options.results)
    printed = io.StringIO()
    console = Console(width=options.width, file=printed, force_terminal=True, highlight=False)
    console.print(f"[bold]$ crosscheck {options.command}[/]")
    print_results(console, results, report=options.report)
    # Render first: a recording cuts lines that the terminal would wrap.
    console = Console(record=True, width=options.width, file=io.StringIO(), force_terminal=True)
    console.print(Text.from_ansi(printed.getvalue().rstrip()), highlight=False)
    theme = DEFAULT_TERMINAL_THEME if options.light else DIMMED_MONOKAI
    # Use any installed monospace font: the picture must not load one from the network.
    form = _FACES.sub("", CONSOLE_SVG_FORMAT).replace("Fira Code", "monospace")
    options.out.write_text(console.export_svg(title="", theme=theme, code_format=form))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
