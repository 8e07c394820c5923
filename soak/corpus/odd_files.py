"""Replacements for a plain file: folders, pipes, devices, links, other encodings."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from soak.corpus.entry import Build


def odd_files(name: str) -> Iterator[tuple[str, Build]]:
    """Yield a name and a build for each replacement of a file in the hostile folder."""

    def replace_file(make: Build) -> Build:
        def build(workspace: Path) -> None:
            path = workspace / "hostile" / name
            path.unlink()
            make(path)

        return build

    def recode(codec: str) -> Build:
        def build(workspace: Path) -> None:
            path = workspace / "hostile" / name
            path.write_bytes(path.read_text("utf-8").encode(codec))

        return build

    def cut_in_half(workspace: Path) -> None:
        path = workspace / "hostile" / name
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])

    yield "a folder", replace_file(lambda path: path.mkdir())
    yield "a pipe", replace_file(os.mkfifo)
    yield "an endless device", replace_file(lambda path: path.symlink_to("/dev/zero"))
    yield "a link to itself", replace_file(lambda path: path.symlink_to(path))
    yield "a link to nothing", replace_file(lambda path: path.symlink_to(path.parent / "nothing"))
    yield "empty", replace_file(lambda path: path.write_bytes(b""))
    yield "zeros", replace_file(lambda path: path.write_bytes(bytes(1000)))
    yield "noise", replace_file(lambda path: path.write_bytes(bytes(range(256)) * 8))
    yield "half of it", cut_in_half
    yield "UTF-16", recode("utf-16")
    yield "UTF-32", recode("utf-32")
