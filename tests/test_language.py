"""Plain English in everything that a person reads; `tests/language.py` has the rules."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import language
from tests.language import PENDING, RULES, Offence, faults, pending, shrunk, write


@pytest.mark.parametrize("rule", RULES)
def test_texts_follow_the_rule(rule: str) -> None:
    messages = faults(rule, list(RULES[rule]()), pending()[rule])
    assert not messages, "\n".join(messages)


def test_each_rule_has_a_list() -> None:
    assert list(pending()) == list(RULES)


LONG = "One " + "word after another " * 9

PLANTED = {
    "prose_words": ("docs/a.md", "The report\ntells it, and *says* so.", "is reported", 2),
    "prose_sentences": (
        "README.md",
        f"Short.\n\n- {LONG}.",
        f"{LONG[:80]}. `code` {LONG[:80]}.",
        1,
    ),
    "table_cells": ("docs/a.md", f"| a | {LONG} |\n|---|---|", "| a | b |", 1),
    "message_words": (
        "harness/x/a.py",
        'raise E(f"joint {j} is no {kind} here") from e\nx = "told"\nTOLD = 3\n"""Of what."""',
        'raise E(f"joint {j} is not a {kind}")',
        1,
    ),
    "message_sentences": ("reference/a.py", f"f({LONG!r})", f"f({LONG[:40]!r})", 1),
    "option_help": (
        "harness/interfaces/cli/a.py",
        f"add('--x', help={LONG!r})",
        "add('--x', help='write results to DIR (reports, or what the settings name, or any "
        "other folder that there is)')",
        1,
    ),
    "docstring_words": (
        "harness/a.py",
        '"""Of what is told."""',
        '"""Words."""\nx = "told him"',
        2,
    ),
    "docstring_first_words": (
        "reference/a.py",
        'def f():\n    """Returns it."""\ndef g():\n    """The mass."""\nclass A:\n    """What."""',
        'def f():\n    """Return it."""\nclass A:\n    """The mass."""\n    @property\n'
        '    def g(self):\n        """The mass."""',
        3,
    ),
    "identifiers": (
        "harness/x/a.py",
        "def _told(one): ...\nfor found in x: self.left = 1\nclass StandIn:\n    at: int",
        "def f(mass): return [one for one in mass], lambda own: own, told\n"
        "class Body:\n    terms: tuple[ForceTerm, ...]",
        6,
    ),
    "class_names": ("harness/a.py", "class A: ...\nclass A: ...", "class A: ...\nclass B: ...", 1),
}


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(language, "ROOT", tmp_path)
    caches = (language.trees, language.messages, language.exported)
    for cache in caches:
        cache.cache_clear()
    yield tmp_path
    for cache in caches:
        cache.cache_clear()


@pytest.mark.parametrize("rule", RULES)
def test_planted_offence_is_reported(rule: str, place: Path) -> None:
    name, text, _, count = PLANTED[rule]
    (place / name).parent.mkdir(parents=True, exist_ok=True)
    (place / name).write_text(text + "\n")
    assert len(list(RULES[rule]())) == count


@pytest.mark.parametrize("rule", RULES)
def test_plain_text_is_accepted(rule: str, place: Path) -> None:
    name, _, text, _ = PLANTED[rule]
    (place / name).parent.mkdir(parents=True, exist_ok=True)
    (place / name).write_text(text + "\n")
    assert not list(RULES[rule]())


def test_prepositions_are_accepted_in_public_declarations(place: Path) -> None:
    for name, text in {
        "physics_crosscheck/__init__.py": "from reference.a import Rest",
        "reference/a.py": "class Rest:\n    at: float\n    def of(self): ...\n"
        "class B:\n    at: float",
    }.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text(text)
    assert [o.place for o in RULES["identifiers"]()] == ["reference/a.py:5"]


def test_report_pages_and_scripts_are_messages(place: Path) -> None:
    for name, text in {
        "pages/a.html": '<p class="told here">No step is {{ x.told }} told</p>',
        "script/a.js": 'make("p", { class: "told by" }, `what ${told} is told`); told(x, "y");',
    }.items():
        (place / "harness/render/html" / name).parent.mkdir(parents=True, exist_ok=True)
        (place / "harness/render/html" / name).write_text(text)
    assert [o.place for o in RULES["message_words"]()] == [
        "harness/render/html/pages/a.html:1",
        "harness/render/html/script/a.js:1",
    ]


def test_code_and_link_targets_are_not_prose(place: Path) -> None:
    (place / "README.md").write_text(
        f"See [the page](told.md) and `is told {LONG}`.\n\n```\ntold {LONG}\n```\n"
    )
    for rule in ("prose_words", "prose_sentences", "table_cells"):
        assert not list(RULES[rule]())


def test_prose_of_a_notebook_is_checked(place: Path) -> None:
    cells = [
        {"cell_type": "markdown", "source": ["The report\n", "tells it."]},
        {"cell_type": "code", "source": ["told = 3"]},
    ]
    (place / "examples").mkdir()
    (place / "examples/a.ipynb").write_text(json.dumps({"cells": cells}))
    assert [o.text for o in RULES["prose_words"]()] == ["tells"]


TWO = [Offence("docs/a.md", "docs/a.md:1", "told"), Offence("docs/a.md", "docs/a.md:7", "says")]


def test_offence_beyond_the_list_fails() -> None:
    assert not faults("prose_words", TWO, {"docs/a.md": 2})
    for allowed in ({}, {"docs/a.md": 1}):
        assert faults("prose_words", TWO, allowed) == [
            "docs/a.md:1: prose_words: told",
            "docs/a.md:7: prose_words: says",
        ]


def test_clean_entry_of_the_list_fails() -> None:
    (message,) = faults("prose_words", TWO, {"docs/a.md": 2, "docs/b.md": 1})
    assert "docs/b.md is clean" in message


def test_lists_only_shrink(tmp_path: Path) -> None:
    lists = {"prose_words": {"a": 3, "b": 1, "c": 2}}
    lower = shrunk(lists, {"prose_words": {"a": 5, "c": 1, "d": 9}})
    assert lower == {"prose_words": {"a": 3, "c": 1}}
    write(lower, tmp_path / "lists.toml")
    assert pending(tmp_path / "lists.toml") == lower
    assert PENDING.is_file()
