"""What may stand in the place of a file: folders, pipes, devices, links, other encodings."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from soak.corpus.entry import Build


def odd_files(name: str) -> Iterator[tuple[str, Build]]:
    """(what it is, how it is made) for a file of the hostile folder."""

    def instead(make: Build) -> Build:
        def build(place: Path) -> None:
            path = place / "hostile" / name
            path.unlink()
            make(path)

        return build

    def recoded(codec: str) -> Build:
        def build(place: Path) -> None:
            path = place / "hostile" / name
            path.write_bytes(path.read_text("utf-8").encode(codec))

        return build

    def cut(place: Path) -> None:
        path = place / "hostile" / name
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])

    yield "a folder", instead(lambda path: path.mkdir())
    yield "a pipe", instead(os.mkfifo)
    yield "an endless device", instead(lambda path: path.symlink_to("/dev/zero"))
    yield "a link to itself", instead(lambda path: path.symlink_to(path))
    yield "a link to nothing", instead(lambda path: path.symlink_to(path.parent / "nothing"))
    yield "empty", instead(lambda path: path.write_bytes(b""))
    yield "zeros", instead(lambda path: path.write_bytes(bytes(1000)))
    yield "noise", instead(lambda path: path.write_bytes(bytes(range(256)) * 8))
    yield "half of it", cut
    yield "UTF-16", recoded("utf-16")
    yield "UTF-32", recoded("utf-32")
