"""A part of the soak: the corpus, planted faults and fuzzed inputs."""

import time
from pathlib import Path

import pytest

from physics_crosscheck import DeclarationError, PublishedEquation
from physics_crosscheck.reference.dynamics.errata import readings
from physics_crosscheck.reference.load import load_system
from soak.corpus.__main__ import chunks, table
from soak.corpus.entries import ENTRIES
from soak.corpus.entry import RUN, CorpusEntry
from soak.corpus.judge import EntryResult, judge, judge_separately
from soak.faults.__main__ import all_faults, run_undisturbed
from soak.faults.sandbox import UndisturbedRun, sandbox
from soak.fuzz.minimize import minimize
from soak.fuzz.target import FuzzFinding, FuzzTarget, SlowError, attack
from soak.fuzz.targets import TARGETS

SLOW_TO_REFUSE = ("tower of powers", "more jobs", "a folder twice")
"""Entries that take long or run a model."""

COMMANDS = [
    entry
    for entry in ENTRIES.values()
    if entry.name.startswith(("arguments/", "report/"))
    and not any(words in entry.name for words in SLOW_TO_REFUSE)
]
FOLDERS = [
    entry
    for entry in ENTRIES.values()
    if entry.batched and entry.name.startswith(("system.py/", "sidecar/", "mjcf/", "frames/"))
][::24]


def wrong(judged: list[EntryResult]) -> list[str]:
    return [
        f"{one.name}: {'; '.join(one.wrong)}: {one.printed[:200]}" for one in judged if one.wrong
    ]


def test_corpus_covers_every_format_and_command() -> None:
    assert len(ENTRIES) > 1000
    assert len(COMMANDS) + len(FOLDERS) > 140
    formats = {name.split("/")[0] for name in ENTRIES}
    assert formats == {
        "system.py", "sidecar", "mjcf", "urdf", "space.py", "report", "baseline", "arguments",
        "new", "compare", "derive", "audit", "gate", "mutate", "wrong", "right", "frames",
        "absent", "pytest",
    }  # fmt: skip


def test_judging_in_a_checkout_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / ".git").mkdir()
    (tmp_path / "mine").write_text("")
    with pytest.raises(RuntimeError, match="is a checkout"):
        judge_separately(COMMANDS[0])
    assert (tmp_path / "mine").is_file()


@pytest.mark.slow
def test_commands_reject_invalid_arguments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert not wrong([judge_separately(entry) for entry in COMMANDS])


@pytest.mark.slow
def test_hostile_folders_fail_alone_and_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert not wrong(list(judge(FOLDERS)))


def test_slow_entries_have_separate_processes() -> None:
    def entry(name: str, **fields: object) -> CorpusEntry:
        return CorpusEntry(name=name, build=lambda folder: None, **fields)  # type: ignore[arg-type]

    some = [entry("a"), entry("b", slow=True), entry("c", command=("derive",)), entry("d")]
    assert [[one.name for one in chunk] for chunk in chunks(some, 2)] == [["c"], ["a", "d"], ["b"]]
    assert entry("a").command == RUN


def test_wrong_entry_is_counted() -> None:
    some = [
        EntryResult(name=name, code=3, printed="", seconds=0.1, wrong=wrong)
        for name, wrong in (("urdf/a", ()), ("urdf/b", ("a traceback is printed",)))
    ]
    assert table(some).splitlines()[1].split() == ["urdf", "2", "1"]


FAULTS = {fault.name: fault for fault in all_faults(seeds=1)}
SOME = ("signals/SIGKILL to the run, seed 0", "streams/into head")


@pytest.fixture(scope="module")
def expected() -> UndisturbedRun:
    return run_undisturbed()


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_fault_in_a_run_loses_no_results(expected: UndisturbedRun, name: str) -> None:
    assert FAULTS[name].check(expected) == []


def test_faults_cover_every_kind() -> None:
    kinds = {name.split("/")[0] for name in FAULTS}
    assert kinds == {"signals", "disk", "streams", "two runs", "models"}
    assert len(all_faults(seeds=5)) > 100


def test_orphaned_process_is_detected() -> None:
    with sandbox(folders=1) as box:
        process = box.start(["sleep", "60"])
        # A moment passes before the system shows a new process's environment.
        for _ in range(200):
            if seen := box.processes():
                break
            time.sleep(0.05)
        process.kill()
        assert seen == [process.pid]
        box.kill_all()
        process.communicate()
        assert box.processes() == []


FINDS = [
    # An address of TOML whose quoted key tomllib refuses, and an index that no int() reads.
    ("toml", b"a.'''\0'''\n---\n[settings]\nstep = 1\n"),
    ("toml", b"a[" + b"9" * 5000 + b"]\n---\na = [1]\n"),
    ("xml", b"a@b[" + b"9" * 5000 + b"]\n---\n<a b='0 0 1'/>"),
    # A prefix that no namespace is bound to.
    ("new_mjcf", b'<mujoco><worldbody><m :=""/></worldbody></mujoco>'),
    # A published equation that Python's parser reads as a string.
    ("notation", b"f''"),
    ("notation", b"'x' = 0"),
    ("notation", b"[x] = x"),
    # Arithmetic that never finishes.
    ("expression", b"-m * l** 1e908"),
    ("expression", b"9**9**9"),
    ("expression", b"2**-9**9**9 * m"),
    # Names that would start a line of the generated system.py.
    ("new_urdf", b"""<robot name="a"><link name="g"/><link name="b&#10; c"><inertial>
<mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<joint name="j&#10;  k" type="continuous"><parent link="g"/><child link="b&#10; c"/></joint></robot>
"""),
    ("new_mjcf", b"""<mujoco><worldbody><body name="a&#10;   b"><joint name="c&#10; d"/>
<inertial pos="0 0 1" mass="2" diaginertia="1 1 1"/></body></worldbody></mujoco>"""),
]  # fmt: skip


@pytest.mark.parametrize(("name", "data"), FINDS)
def test_earlier_failures_are_rejected_or_read(name: str, data: bytes) -> None:
    assert attack(TARGETS[name], data) is None


@pytest.mark.parametrize("name", TARGETS)
def test_every_seed_satisfies_the_contract(name: str) -> None:
    for seed in list(TARGETS[name].seeds())[:4]:
        assert attack(TARGETS[name], seed) is None


def test_invalid_equation_is_reported_by_its_number() -> None:
    from physics_crosscheck.harness.modelfiles.folders import builtin

    system = load_system(builtin() / "simple_pendulum")
    published = PublishedEquation("3.7", "f''", "motion", of="theta", driven=False, note="")
    with pytest.raises(
        DeclarationError, match=r"Eq\. 3\.7: can't read .*is not a number, a name or"
    ):
        readings(published, system)


def raising(data: bytes) -> object:
    if b"no" in data:
        raise KeyError(data)
    if b"slow" in data:
        while True:
            pass
    raise ValueError


WRONG = FuzzTarget(name="w", parse=raising, errors=(ValueError,), seeds=lambda: iter(()), words=())


def test_broken_contract_is_detected_and_minimized() -> None:
    assert attack(WRONG, b"yes") is None
    failure = attack(WRONG, b"yes and no and so on")
    assert isinstance(failure, FuzzFinding)
    assert failure.location.startswith("KeyError")
    assert minimize(WRONG, failure.input) == b"no"


@pytest.mark.slow
def test_slow_input_is_detected() -> None:
    failure = attack(WRONG, b"slow")
    assert failure is not None
    assert failure.message.startswith(SlowError.__name__)
