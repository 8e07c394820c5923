"""What differs between two files, and what would have to be written in the first to make it so."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.compare.candidate import Candidate
from physics_crosscheck.harness.compare.diff import applied, edits
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from tests.compare.asking import written


def between(
    folder: Path, suffix: str, one: str, other: str
) -> tuple[list[tuple[str, int | None, int | None, str, str]], str]:
    """Differences of two texts, as (label, line in A, line in B, old, new), and A made B."""
    files = written(folder, f"a{suffix}", one), written(folder, f"b{suffix}", other)
    sides = [
        Candidate(
            "A",
            Sidecar(
                model=f,
                engines=("any",),
                settings={},
                engine_settings={},
                coordinates={},
                readback={},
                springs=(),
            ),
            "any",
        )
        for f in files
    ]
    found = edits(*sides)
    told = [(e.label, e.where_a.line, e.where_b.line, e.old, e.new) for e in found]
    return told, applied(one.encode(), found).decode()


def test_a_number_of_a_vector_is_one_difference(tmp_path: Path) -> None:
    told, made = between(
        tmp_path,
        ".xml",
        '<m>\n<b name="rod" pos="0 1\n 2"/></m>',
        '<m><b name="rod" pos="0  1.0 2.5"/></m>',
    )
    assert told == [("b[rod]@pos[2]", 2, 1, "2", "2.5")]
    assert made == '<m>\n<b name="rod" pos="0 1\n 2.5"/></m>'


@pytest.mark.parametrize(("one", "other"), [
    ('<m><b x="1"/></m>', '<m><b   x = \'1.0\'></b></m>'),
    ("<m><b>1</b></m>", "<m><!-- new -->\n<b> 1e0 <!-- old --></b></m>"),
    ('<m><b name="one"/><b name="two"/></m>', '<m><b name="two"/><b name="one"/></m>'),
    ('<m a="1" b="2"/>', '<m b="2" a="1"/>'),
])  # fmt: skip
def test_the_same_said_otherwise_is_no_difference(tmp_path: Path, one: str, other: str) -> None:
    assert between(tmp_path, ".xml", one, other)[0] == []


@pytest.mark.parametrize(("one", "other", "told"), [
    ('<m><b n="1"/></m>', '<m><b n="1" k="2"/></m>', ("b@k", "nothing", "2")),
    ('<m><b n="1" k="2"/></m>', '<m><b n="1"/></m>', ("b@k", "2", "nothing")),
    ('<m><b n="1 2"/></m>', '<m><b n="1 2 3"/></m>', ("b@n", "1 2", "1 2 3")),
    ('<m><b t="hinge"/></m>', '<m><b t="slide"/></m>', ("b@t", "hinge", "slide")),
    ("<m><b>3</b></m>", "<m><b>4</b></m>", ("b", "3", "4")),
    ("<m><b/></m>", '<m><b/><c k="1"/></m>', ("c", "nothing", '<c k="1"/>')),
    ('<m><b/><c k="1"><d/></c></m>', "<m><b/></m>", ("c", '<c k="1"><d/></c>', "nothing")),
    ('<m><j name="a"/></m>', '<m><j name="b"/></m>', ("j[a]@name", "a", "b")),
])  # fmt: skip
def test_every_kind_of_difference_can_be_made(
    tmp_path: Path, one: str, other: str, told: tuple[str, ...]
) -> None:
    found, made = between(tmp_path, ".xml", one, other)
    assert [(label, old, new) for label, _, _, old, new in found] == [told]
    assert between(tmp_path, ".xml", made, other)[0] == []


def test_numbers_of_python_are_told_by_their_names_or_lines(tmp_path: Path) -> None:
    one = "MASS = 2.0  # kg\n\ndef build():\n    '''Old.'''\n    return MASS, -0.5, 7\n"
    other = "\nMASS = 2.5\ndef build():\n    'New.'\n    return MASS, +0.5, 7.0\n"
    told, made = between(tmp_path, ".py", one, other)
    assert told == [("MASS", 1, 2, "2.0", "2.5"), ("number", 5, 5, "-0.5", "+0.5")]
    assert "MASS = 2.5  # kg" in made
    assert "return MASS, +0.5, 7" in made


def test_other_code_is_told_at_its_first_line_and_tried_as_a_whole(tmp_path: Path) -> None:
    one, other = "a = 1\nb = a\n", "a = 1\nb = a * 2\n"
    told, made = between(tmp_path, ".py", one, other)
    assert [entry[:3] for entry in told] == [("code", 2, 2)]
    assert made == other


@pytest.mark.parametrize(("suffix", "text", "sentence"), [
    (".xml", "<m><b></m>", r"b.xml:1: not XML"),
    (".xml", "<!DOCTYPE m [<!ENTITY a 'b'>]><m/>", "entities or a DTD"),
    (".py", "a = (", r"b.py:1: no Python"),
])  # fmt: skip
def test_a_file_that_cannot_be_read_is_named_with_its_line(
    tmp_path: Path, suffix: str, text: str, sentence: str
) -> None:
    with pytest.raises(LocationError, match=sentence):
        between(tmp_path, suffix, {".xml": "<m/>", ".py": "a = 1"}[suffix], text)
