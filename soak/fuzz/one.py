"""Fuzz one parser in this process: `python -m soak.fuzz.one NAME SECONDS FINDS CORPUS`.

Started by `python -m soak.fuzz`. What is imported from here on is instrumented, so that mutations
that reach new branches are kept (libFuzzer through Atheris). A find is written and not raised: the
search goes on.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import sys
import warnings
from pathlib import Path

import atheris

SLOWEST = 30
"""Seconds after which libFuzzer ends the process: what Python's own clock can't interrupt."""


def main() -> None:
    """Fuzz until the time is over."""
    name, seconds, finds, corpus = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]), sys.argv[4]
    warnings.simplefilter("ignore")
    logging.disable()
    with atheris.instrument_imports(include=["harness", "reference", "tomllib"]):
        from soak.fuzz.targets import TARGETS
    from soak.fuzz.target import attack

    target = TARGETS[name]
    for seed in target.seeds():
        Path(corpus, hashlib.sha256(seed).hexdigest()[:16]).write_bytes(seed)
    known: set[str] = set()

    def one(data: bytes) -> None:
        with contextlib.redirect_stderr(None), contextlib.redirect_stdout(None):
            found = attack(target, data)
        if found is not None and found.place not in known:
            known.add(found.place)
            key = hashlib.sha256(found.place.encode()).hexdigest()[:12]
            (finds / f"{name}-{key}.input").write_bytes(data)
            (finds / f"{name}-{key}.txt").write_text(f"{found.place}\n{found.told}\n", "utf-8")

    words = Path(corpus).parent / f"{name}.dict"
    words.write_text("".join(f'"{_spelled(word)}"\n' for word in target.words), "ascii")
    atheris.Setup(
        [
            sys.argv[0],
            corpus,
            f"-dict={words}",
            f"-max_total_time={seconds}",
            f"-timeout={SLOWEST}",
            "-rss_limit_mb=4096",
            "-max_len=6000",
            "-print_final_stats=1",
            "-verbosity=1",
            f"-artifact_prefix={finds / name}-stopped-",
        ],
        one,
        enable_python_coverage=True,
    )
    atheris.Fuzz()


def _spelled(word: str) -> str:
    return "".join(f"\\x{byte:02x}" for byte in word.encode())


if __name__ == "__main__":
    main()
