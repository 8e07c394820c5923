"""A process that fuzzes one parser: `python -m soak.fuzz.one NAME SECONDS FINDS CORPUS`.

`python -m soak.fuzz` starts this process. Atheris instruments the imports below, so that libFuzzer
keeps mutations that reach new branches. A find is written to a file and not raised, so that the
search continues.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import sys
import warnings
from pathlib import Path

import atheris

TIMEOUT_SECONDS = 30
"""Time after which libFuzzer ends a process that Python's own timer cannot interrupt."""


def main() -> None:
    """Fuzz until the time limit."""
    name, seconds, finds, corpus = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]), sys.argv[4]
    warnings.simplefilter("ignore")
    logging.disable()
    with atheris.instrument_imports(include=["physics_crosscheck", "tomllib"]):
        from soak.fuzz.targets import TARGETS
    from soak.fuzz.target import attack

    target = TARGETS[name]
    for seed in target.seeds():
        Path(corpus, hashlib.sha256(seed).hexdigest()[:16]).write_bytes(seed)
    locations: set[str] = set()

    def attack_once(data: bytes) -> None:
        with contextlib.redirect_stderr(None), contextlib.redirect_stdout(None):
            find = attack(target, data)
        if find is not None and find.location not in locations:
            locations.add(find.location)
            key = hashlib.sha256(find.location.encode()).hexdigest()[:12]
            (finds / f"{name}-{key}.input").write_bytes(data)
            (finds / f"{name}-{key}.txt").write_text(f"{find.location}\n{find.message}\n", "utf-8")

    words = Path(corpus).parent / f"{name}.dict"
    words.write_text("".join(f'"{_escape(word)}"\n' for word in target.words), "ascii")
    atheris.Setup(
        [
            sys.argv[0],
            corpus,
            f"-dict={words}",
            f"-max_total_time={seconds}",
            f"-timeout={TIMEOUT_SECONDS}",
            "-rss_limit_mb=4096",
            "-max_len=6000",
            "-print_final_stats=1",
            "-verbosity=1",
            f"-artifact_prefix={finds / name}-stopped-",
        ],
        attack_once,
        enable_python_coverage=True,
    )
    atheris.Fuzz()


def _escape(word: str) -> str:
    return "".join(f"\\x{byte:02x}" for byte in word.encode())


if __name__ == "__main__":
    main()
