"""Hostile files: each is rejected at once with one sentence, and other files still run."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck import System
from physics_crosscheck.harness.documents import reading
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import SourceFile
from physics_crosscheck.harness.interfaces.pytest_plugin.session import targets_under
from physics_crosscheck.harness.modelfiles.bindings import bindings
from physics_crosscheck.harness.modelfiles.folders import FolderError, builtin, system_folders
from physics_crosscheck.harness.modelfiles.locations import find, toml_literals
from physics_crosscheck.harness.modelfiles.model_files import UnreadModel, model_files
from physics_crosscheck.harness.modelfiles.robot_targets import robots_below
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError, read_sidecar
from physics_crosscheck.harness.planning.model_plan import text_of
from physics_crosscheck.reference.load import load_system

XML = '<mujoco><worldbody><body name="b"><joint name="x"/></body></worldbody></mujoco>'
SIDECAR = 'engines = ["mujoco"]\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a valid model and its sidecar."""
    folder = tmp_path / "system"
    folder.mkdir()
    (folder / "m.xml").write_text(XML)
    (folder / "m.xml.toml").write_text(SIDECAR)
    return folder


def rejection(folder: Path) -> str:
    """Return the reason, one short line, for which the only model of a folder is rejected."""
    began = time.process_time()
    (model,) = model_files(folder)
    assert time.process_time() - began < 5
    assert isinstance(model, UnreadModel), model
    assert "\n" not in model.reason
    assert len(model.reason) < 600
    return model.reason


def make_pipe(path: Path) -> None:
    os.mkfifo(path)


def make_socket(path: Path) -> None:
    here = Path.cwd()
    os.chdir(path.parent)  # the full path is too long for a socket
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(path.name)
    os.chdir(here)


def make_folder(path: Path) -> None:
    path.mkdir()


def make_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def make_loop(path: Path) -> None:
    path.symlink_to(path.name)


KINDS: tuple[tuple[Callable[[Path], None], str], ...] = (
    (make_pipe, "it is a named pipe; expected a file"),
    (make_socket, "it is a socket; expected a file"),
    (make_folder, "it is a folder; expected a file"),
    (make_device, "it is a device; expected a file"),
    (make_loop, "symbolic links"),
)


@pytest.mark.parametrize(("make", "sentence"), KINDS)
def test_sidecar_that_is_not_a_file_is_not_opened(
    folder: Path, make: Callable[[Path], None], sentence: str
) -> None:
    (folder / "m.xml.toml").unlink()
    make(folder / "m.xml.toml")
    assert f"m.xml.toml: can't be read: {sentence}" in rejection(folder).replace(
        "Too many levels of ", ""
    )


@pytest.mark.parametrize(("make", "sentence"), KINDS[:4])
def test_model_that_is_not_a_file_is_not_opened(
    folder: Path, make: Callable[[Path], None], sentence: str
) -> None:
    (folder / "m.xml").unlink()
    make(folder / "m.xml")
    assert f"m.xml: can't be read: {sentence}" in rejection(folder)


@pytest.mark.parametrize("body", [
    '<include file="part"/>',
    '<asset><mesh file="part"/></asset>',
    '<compiler meshdir="."/><asset><mesh name="p" file="p&#97;rt"/></asset>',
])  # fmt: skip
def test_pipe_that_a_model_names_is_not_opened(folder: Path, body: str) -> None:
    os.mkfifo(folder / "part")
    (folder / "m.xml").write_text(f"<mujoco>{body}</mujoco>")
    assert f"{folder / 'm.xml'}: it names {folder / 'part'}: can't be read: it is a named pipe" in (
        rejection(folder)
    )


def test_pipe_in_a_folder_of_robots_is_not_opened(tmp_path: Path) -> None:
    """Catch a search for robot files that waits for the pipe's writer."""
    os.mkfifo(tmp_path / "m.xml")
    (tmp_path / "robot.xml").write_text("<mujoco/>")
    assert robots_below(tmp_path) == [tmp_path / "robot.xml"]


@pytest.mark.parametrize(("make", "_"), KINDS)
def test_system_that_is_not_a_file_is_not_opened(
    tmp_path: Path, make: Callable[[Path], None], _: str
) -> None:
    make(tmp_path / "system.py")
    with pytest.raises(ValueError, match=r"system\.py: not a file"):
        load_system(tmp_path)


@pytest.mark.parametrize(("make", "_"), KINDS)
def test_folder_with_an_unreadable_system_is_a_system_folder(
    tmp_path: Path, make: Callable[[Path], None], _: str
) -> None:
    """Catch robot files that run without a message about the unreadable system.py."""
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "m.xml").write_text(XML)
    make(tmp_path / "arm" / "system.py")
    for target in (tmp_path, tmp_path / "arm"):
        assert robots_below(target) == []
        assert targets_under(str(target), ()) == [tmp_path / "arm"]


class CountingBytes(bytes):
    """Bytes that count how many of them are copied."""

    copied = 0

    def __getitem__(self, index: Any) -> Any:
        part = super().__getitem__(index)
        CountingBytes.copied += len(part) if isinstance(part, bytes) else 1
        return part


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_locating_many_numbers_copies_the_file_at_most_twice(
    end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catch a copy of the text before each number: 50000 keys took ten minutes."""
    monkeypatch.setattr(CountingBytes, "copied", 0)
    lines = [f'"\u00e9{i}" = {i}' for i in range(500)]
    source = SourceFile(Path("a.toml"), CountingBytes(end.join(lines).encode()))
    places = list(toml_literals(source))
    assert [(one.line, one.column, one.value) for one in places] == [
        (i + 1, len(line) - len(str(i)) + 1, i) for i, line in enumerate(lines)
    ]
    assert CountingBytes.copied < 2 * len(source.data)


@pytest.mark.slow
def test_oversized_files_are_not_read(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with (folder / "m.xml").open("ab") as file:
        file.truncate(reading.MAX_MODEL_BYTES + 1)
    assert "m.xml: can't be read: it has 64.0 MB; at most 64 MB are allowed" in rejection(folder)
    with (folder / "m.xml.toml").open("ab") as file:
        file.truncate(reading.MAX_SIDECAR_BYTES + 1)
    assert "it has 1.0 MB; at most 1 MB are allowed" in rejection(folder)


def test_file_without_read_permission_is_reported(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = Path.read_bytes

    def refuse(self: Path) -> bytes:
        if self.name == "m.xml":
            raise PermissionError(13, "Permission denied", str(self))
        return real(self)

    monkeypatch.setattr(Path, "read_bytes", refuse)
    assert "m.xml: can't be read: Permission denied" in rejection(folder)


def test_file_deleted_after_listing_is_reported(folder: Path) -> None:
    (sidecar,) = model_files(folder)
    assert isinstance(sidecar, Sidecar)
    sidecar.model.unlink()
    assert text_of(sidecar.model) == ""
    assert "there is no model file m.xml" in rejection(folder)


DEEP = 5000
TOML: dict[str, tuple[str, str]] = {
    "an integer of 400 digits": (f"[settings]\nstep = {'9' * 400}", "of more than 64 bits"),
    "an integer of 5000 digits": (f"[settings]\nstep = {'9' * 5000}", ":3: a number has too many"),
    "a hexadecimal of 5000": (f"[settings]\nstep = 0x{'f' * 5000}", "of more than 64 bits"),
    "arrays in arrays": (f"a = {'[' * DEEP}{']' * DEEP}", "nested"),
    "a few arrays in arrays": (f"a = {'[' * 60}{']' * 60}", "nested"),
    "tables in tables": (f"a = {'{a = ' * DEEP}1{'}' * DEEP}", "nested"),
    "a key of parts": (f"{'a.' * DEEP}b = 1", ":2: a key of more than 100 parts"),
    "a table of parts": (f"[{'a.' * DEEP}b]", ":2: a key of more than 100 parts"),
    "a table of some parts": (f"[{'a.' * 60}b]\nc = 1", "nested"),
    "an open array": ("a = " + "[" * DEEP, "nested"),
    "a long key": (f"{'a' * 100_000} = 1", "unknown key 'aaaa"),
    "a long engine": (f"[settings.{'a' * 100_000}]\nstep = 1", "is for an engine that"),
    "a long value": (f"[settings]\nstep = '{'a' * 100_000}'", "step is 'aaaa"),
    "a zero byte": ("a = '\0'", "not TOML"),
    "a step of NaN": ("[settings]\nstep = nan", "step is nan"),
    "a step of infinity": ("[settings]\nstep = inf", "step is inf"),
    "a repeated engine": ('engines = ["mujoco", "mujoco"]', "lists 'mujoco' twice"),
}  # fmt: skip


@pytest.mark.parametrize("name", TOML)
def test_unreasonable_sidecar_is_rejected(folder: Path, name: str) -> None:
    text, sentence = TOML[name]
    head = "" if text.startswith("engines") else SIDECAR
    (folder / "m.xml.toml").write_text(head + text)
    message = rejection(folder)
    assert message.startswith(f"{folder / 'm.xml.toml'}:")
    assert sentence in message


def test_bytes_that_are_not_utf8_are_reported(folder: Path) -> None:
    (folder / "m.xml.toml").write_bytes(SIDECAR.encode() + b"# \xff")
    assert "byte 23 is not UTF-8; save the file as UTF-8" in rejection(folder)


MODELS: dict[str, tuple[str, str]] = {
    "a DTD": ("<!DOCTYPE mujoco>\n<mujoco/>", ":1: refused: it declares entities or a DTD"),
    "entities in entities": (
        '<?xml version="1.0"?>\n<!DOCTYPE m [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]>\n'
        "<mujoco model='&b;'/>", ":2: refused: it declares entities or a DTD"),
    "an external entity": (
        '<!DOCTYPE m [<!ENTITY a SYSTEM "file:///etc/passwd">]>\n<mujoco/>', ":1: refused"),
    "a DTD after two roots": ("<mujoco/>\n<mujoco/>\n<!DOCTYPE mujoco>", ":3: refused"),
    "elements in elements": (
        f"<mujoco>\n{'<frame>' * DEEP}{'</frame>' * DEEP}</mujoco>",
        ":2: refused: more than 300 nested elements"),
    "elements without an end": ("<mujoco>" + "\n<frame>" * DEEP, ":301: refused: more than 300"),
}  # fmt: skip


@pytest.mark.parametrize("name", MODELS)
def test_harmful_model_is_refused_with_its_line(folder: Path, name: str) -> None:
    text, sentence = MODELS[name]
    (folder / "m.xml").write_text(text)
    assert f"{folder / 'm.xml'}{sentence}" in rejection(folder)
    # The same holds for an included file of any name.
    (folder / "m.xml").write_text('<mujoco><include file="p&#97;rt.inc"/></mujoco>')
    (folder / "part.inc").write_text(text)
    assert f"part.inc{sentence}" in rejection(folder)


def test_text_that_looks_like_a_dtd_is_accepted(folder: Path) -> None:
    (folder / "m.xml").write_text("<mujoco><!-- <!DOCTYPE a> --><![CDATA[<!ENTITY]]></mujoco>")
    assert isinstance(next(model_files(folder)), Sidecar)


def test_nested_includes_are_limited(folder: Path) -> None:
    for i in range(110):
        (folder / f"p{i}").write_text(f'<mujocoinclude><include file="p{i + 1}"/></mujocoinclude>')
    (folder / "p110").write_text("<mujocoinclude/>")
    (folder / "m.xml").write_text('<mujoco><include file="p80"/></mujoco>')
    assert isinstance(next(model_files(folder)), Sidecar)
    (folder / "m.xml").write_text('<mujoco><include file="p0"/></mujoco>')
    assert "m.xml: more than 100 nested includes" in rejection(folder)


@pytest.mark.parametrize("name", [b"new\nline.xml", b"\xff\xfe.xml", b"\x1b[31mred.xml"])
def test_unprintable_file_name_is_escaped(folder: Path, name: bytes) -> None:
    for ending in (b"", b".toml"):
        path = Path(os.fsdecode(os.fsencode(folder) + b"/" + name + ending))
        path.write_text(SIDECAR if ending else XML)
        unread = [one for one in model_files(folder) if isinstance(one, UnreadModel)]
        (model,) = unread
        assert model.reason.isprintable()
        assert model.model.isprintable()
        assert model.reason.endswith("; rename it")


def test_unprintable_folder_name_is_refused(tmp_path: Path) -> None:
    for name in ("new\nline", "\udcff", "\x1b[31m"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "system.py").write_text("")
        with pytest.raises(FolderError, match="; rename it") as error:
            system_folders([str(tmp_path / name)])
        assert str(error.value).isprintable()


def test_folder_with_a_broken_system_link_is_listed(tmp_path: Path) -> None:
    """Catch models that pass because they never run."""
    for name in ("broken", "sound"):
        (tmp_path / name).mkdir()
    (tmp_path / "broken" / "system.py").symlink_to("system.py")
    (tmp_path / "sound" / "system.py").write_text("")
    assert system_folders([str(tmp_path)]) == [tmp_path / "broken", tmp_path / "sound"]
    assert system_folders([str(tmp_path / "broken")]) == [tmp_path / "broken"]


@pytest.mark.parametrize(("suffix", "engine", "lines"), [
    (".xml", "mujoco", 3), (".py", "pymunk", 3),
])  # fmt: skip
def test_springs_that_an_engine_would_ignore_are_refused(
    tmp_path: Path, suffix: str, engine: str, lines: int
) -> None:
    (tmp_path / f"m{suffix}").write_text(XML if suffix == ".xml" else "")
    (tmp_path / f"m{suffix}.toml").write_text(
        f'engines = ["{engine}"]\n[[spring]]\njoints = {{x = 1}}\n'
        "stiffness = 1\ndamping = 0\nrest = 0\n"
    )
    message = rejection(tmp_path)
    assert f"m{suffix}.toml:{lines}: [[spring]]: " in message
    assert (
        f"takes no springs from the sidecar of a {suffix} file; write them into m{suffix} itself"
        in message
    )


@pytest.fixture(scope="module")
def spring() -> System:
    """Return a system with a constant m."""
    return load_system(builtin() / "mass_spring_damper")


EXPRESSIONS = (
    "9**9**9", "2**2**2**2**99", "m*9**9**9", "m**(10**9)", "factorial(10**9)", "((m+1)**64)**64",
    "m**m", "m/0", "m/(m - m)", "log(0)", "asin(2)", "sqrt(-1)", "1e400", "1e999999999",
    "9" * 400, "9" * 5000, "zoo", "nan", "oo", "I", "1j", "0x10", "exp(exp(exp(exp(9))))",
    "(" * 5000 + "m" + ")" * 5000, "-" * 1900 + "m", "+".join("m" * 900), "m" * 3000,
    "__import__('os').system('true')", "m.__class__", "lambda: m", "[m for m in m]",
    "m if m else 1",
)  # fmt: skip


@pytest.mark.parametrize("text", EXPRESSIONS, ids=lambda text: text[:20])
def test_hostile_expression_is_rejected_with_its_line(
    tmp_path: Path, spring: System, text: str
) -> None:
    (tmp_path / "m.py").write_text("MASS = 1.3\n")
    path = tmp_path / "m.py.toml"
    path.write_text(f'engines = ["pymunk"]\n[bindings]\nMASS = "{text}"\n')
    began = time.process_time()
    with pytest.raises(SidecarError) as error:
        bindings(spring, read_sidecar(path))
    assert time.process_time() - began < 5
    message = str(error.value)
    assert message.startswith(f"{path}:3: [bindings] 'MASS'")
    assert "\n" not in message
    assert len(message) < 600


@pytest.mark.parametrize("file", ["m.xml", "m.toml"])
def test_index_of_thousands_of_digits_is_refused(tmp_path: Path, file: str) -> None:
    (tmp_path / file).write_text("<a b='1 2'/>" if file == "m.xml" else "b = [1, 2]")
    address = {"m.xml": "a@b[", "m.toml": "b["}[file] + "9" * 5000 + "]"
    with suppress(LocationError):
        find(tmp_path / file, [address])
        raise AssertionError(file)


@pytest.fixture(autouse=True)
def no_open_files() -> Iterator[None]:
    """Check that a test leaves no file open.

    Files that earlier tests opened may be closed meanwhile, by threads or by garbage collection.
    """
    before = open_files()
    yield
    assert open_files() <= before


def open_files() -> set[tuple[str, str]]:
    """Return the number and the target of each open file of this process."""
    links = set()
    for link in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # the listing itself, or closed meanwhile
            links.add((link.name, os.readlink(link)))
    return links
