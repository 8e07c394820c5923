"""The rules of plain language, as searches of this repository, and what is not converted yet.

`python -m tests.language` removes from `language.toml` what has become clean; it adds nothing.
"""

import ast
import gc
import json
import re
import sys
import tomllib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from physics_crosscheck.harness.interfaces.cli.reference import generated_pages

ROOT = Path(__file__).parents[1]
PENDING = ROOT / "tests" / "language.toml"

MOST_WORDS = 25  # of a sentence
MOST_CELL_WORDS = 15
MOST_HELP_WORDS = 12

CODE = ("harness", "reference", "physics_crosscheck", "benchmarks", "campaigns", "soak", "tests")
PAYLOADS = "soak/corpus/", "tests/"
"""Folders whose texts are inputs for parsers, and expected outputs."""

DOCS = ("docs/**/*.md", "README.md", "examples/*.ipynb")
PAGES = (*DOCS, "*.md", "campaigns/**/*.md", "soak/**/*.md")

# A pattern, and what to write instead.
BANNED = {
    r"tell(?:s|ing)?|told": "report, state, explain",
    r"sa(?:ys?|ying|id)": "state, report",
    r"(?:is|are|was|be) had": "name the actor",
    r"mend(?:s|ed|ing)?": "fix, correct",
    r"read(?:s|ing)? over": "ignore",
    r"(?:is|are|was|were|be) another": "differ",
    r"st(?:ands?|ood|anding) beside": "is next to, compared with",
    r"h(?:olds?|eld) (?:\w+ )?against": "compare with",
    r"b(?:ears?|ore|orne) (?:it |them )?out": "confirm",
    r"in the way\b(?! (?:that|of))": "prevent",
    r"go(?:es)? on|going on|went on": "continue, resume",
    r"no more than": "at most",
    r"(?:is|are|as good as) none": "does not exist, is ignored",
    r"what is to be": "what must be",
    r"of what": "name the thing",
    r"(?<!there )(?:is|are|was) no (?!longer\b|more\b|less\b|other\b)": "is not a",
    r"where [^.;,]{1,60} belongs?": "expected ...",
    r"but for|anew": "except, again",
    r"(?<!of[ -])freedoms?": "degrees of freedom",
    r"shipped steps?": "time step, dt",
    r"principal moments(?! of inertia)": "principal moments of inertia",
    r"foret(?:ells?|old)": "predict",
    r"(?:sensitive|too sensitive) (?:motions?|cases?|to)": "chaotic",
    r"unseen": "untested",
}
_BANNED = re.compile(
    "|".join(rf"\b(?:{pattern})" + r"\b" * (pattern[-1] not in ") ") for pattern in BANNED), re.I
)

_RULE_4 = "one found known told said asked left made them own at of"
_TABLE = """
    told piece work placework begun interruption post terms sure alone hinder hang settled
    saying say put numeral recent most crew taken remedies unstated bare_link standing runners
    readers bent bends handed_down asks felt tidy late unheld legible filled evenly brief cut
    trouble gathered had keep collected stand_in luggage parcel packed unload station
    surroundings asked_for meant_by hurdle barred_case obstacle reworded spliced redrawn
    suspicion beside undone written_like idle reach side partners lump bush cord medium pull
    telling witness bears_out foretold claim many enough few look ahead
"""
NAMES = frozenset((_RULE_4 + _TABLE).split())

# First words of docstrings that are no verb in the imperative.
_ANYWHERE = {"What", "Of", "As", "Where", "Whether", "Those"}
_NOUNS = """
    A All An Another Any At Between Both By Each Every Everything From How In Is It Its Likewise
    Meanwhile Neither No None Nobody Nothing On One Other Per Relative Second Some Something Such
    That The Their These This Two Twice Which Who Whatever When With Within Without Why
"""
_FUNCTION = frozenset(_NOUNS.split())
_ENDS_IN_S = {"Pass", "Process", "Bias", "Address", "Compress", "Express", "Access", "Focus"}


class Offence(NamedTuple):
    """A place that breaks a rule: `unit` is its room or page."""

    unit: str
    place: str
    text: str


Rule = Callable[[], Iterator[Offence]]


class Text(NamedTuple):
    """A literal, docstring or name in a file."""

    path: Path
    line: int
    text: str
    function: bool = True


def room(path: Path) -> str:
    """Return the folder that a file of code is counted in, such as `harness/modelfiles`."""
    return "/".join(path.relative_to(ROOT).parts[:-1][:2])


def banned(text: str) -> list[str]:
    """Return the banned phrases of a text."""
    return [match[0] for match in _BANNED.finditer(re.sub(r"\s+", " ", text))]


def banned_name(name: str) -> bool:
    """Return whether a name is banned."""
    snake = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    return snake.strip("_") in NAMES


def sentences(paragraph: str) -> Iterator[str]:
    """Yield the sentences of a paragraph in which code and links are already plain words."""
    yield from re.split(r"(?<=[.!?])\s+(?=[A-Z`*(\d]|code\b)", paragraph)


def words(text: str) -> int:
    """Count the words of a text."""
    return sum(1 for word in text.split() if re.search(r"\w", word))


def first_word_is_wrong(docstring: str, *, function: bool) -> bool:
    """Return whether a docstring begins otherwise than with a verb, or a class's with a noun."""
    first = re.split(r"[\s,.;:]", docstring.strip(), maxsplit=1)[0]
    if first in _ANYWHERE or not function:
        return first in _ANYWHERE
    third_person = re.fullmatch(r"[A-Z][a-z]+[^s\W]s", first) and first not in _ENDS_IN_S
    return first in _FUNCTION or bool(third_person)


def paragraphs(markdown: str) -> Iterator[tuple[int, str]]:
    """Yield the first line and the text of each paragraph, list item, heading and table row."""
    fenced, start, lines = False, 1, list[str]()
    for number, line in enumerate([*markdown.splitlines(), ""], 1):
        shown = line.strip()
        fence = shown.startswith(("```", "~~~"))
        fenced ^= fence
        single = shown.startswith(("#", "|", "<"))
        if fence or fenced or single or not shown or re.match(r"(?:[-*+]|\d+\.|>|:) ", shown):
            if lines:
                yield start, " ".join(lines)
            lines = []
        if fence or fenced or not shown:
            continue
        if single:
            yield number, shown
            continue
        start = start if lines else number
        lines.append(re.sub(r"^(?:[-*+]|\d+\.|>|:) ", "", shown))


def plain(text: str) -> str:
    """Return Markdown with code as one word, and links as their texts."""
    text = re.sub(r"!?\[((?:[^][]|\[[^]]*\])*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"(`+).+?\1", "code", text)


def pages(*patterns: str) -> Iterator[tuple[str, int, str]]:
    """Yield page, line and plain text of every paragraph; of a notebook, the line in its prose."""
    for path in sorted({path for pattern in patterns for path in ROOT.glob(pattern)}):
        for line, text in paragraphs(_markdown(path)):
            yield str(path.relative_to(ROOT)), line, plain(text)
    if DOCS[0] in patterns:
        for name, page in generated_pages().items():
            if name.startswith("reference/"):
                for line, text in paragraphs(page):
                    yield f"docs/{name}", line, plain(text)


def _markdown(path: Path) -> str:
    """Return the text of a page, or the Markdown cells of a notebook."""
    if path.suffix == ".md":
        return path.read_text()
    cells = json.loads(path.read_text())["cells"]
    return "\n\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "markdown")


@lru_cache(maxsize=1)
def trees() -> tuple[tuple[Path, list[ast.AST]], ...]:
    """Return the nodes of every file of code, parsed once."""
    files = (path for name in CODE for path in (ROOT / name).rglob("*.py"))
    gc.disable()  # a million nodes: looking for garbage among them takes longer than parsing
    try:
        return tuple(
            (path, list(ast.walk(ast.parse(path.read_text()))))
            for path in sorted(files)
            if _inside(path)
        )
    finally:
        gc.enable()


def _inside(path: Path) -> bool:
    """Leave out what a link leads to a second time."""
    return not any(parent.is_symlink() for parent in path.parents)


def _docstring_nodes(nodes: list[ast.AST]) -> Iterator[tuple[ast.AST, ast.Constant]]:
    """Yield each string that stands as a statement, after the body's owner: of constants too."""
    for node in nodes:
        body = getattr(node, "body", None)
        parts: list[ast.AST] = body if isinstance(body, list) else []
        for i, part in enumerate(parts):
            match part:
                case ast.Expr(value=ast.Constant(value=str()) as text):
                    yield part if i else node, text


def docstrings() -> Iterator[Text]:
    """Yield every docstring; `function` is false of classes, modules, constants and properties."""
    for path, nodes in trees():
        for node, text in _docstring_nodes(nodes):
            function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not any(
                "property" in ast.unparse(decorator) for decorator in node.decorator_list
            )
            yield Text(path, text.lineno, str(text.value), function)


def literals(nodes: list[ast.AST]) -> Iterator[tuple[int, str]]:
    """Yield every string with a blank that is not a docstring; `{}` is a value of an f-string."""
    skipped = {id(text) for _, text in _docstring_nodes(nodes)}
    for node in nodes:  # an f-string comes before its parts
        if isinstance(node, ast.JoinedStr):
            skipped |= {id(part) for part in ast.walk(node) if isinstance(part, ast.Constant)} - {
                id(inner)
                for part in node.values
                if isinstance(part, ast.FormattedValue)
                for inner in ast.walk(part.value)
            }
            parts = [p.value if isinstance(p, ast.Constant) else "{}" for p in node.values]
            yield node.lineno, "".join(map(str, parts))
        match node:
            case ast.Constant(value=str(text)) if id(node) not in skipped and " " in text.strip():
                yield node.lineno, text


@lru_cache(maxsize=1)
def messages() -> tuple[Text, ...]:
    """Return what the program and the report's templates show, a text each."""
    return (*_strings(), *_codes(), *_templates())


def _strings() -> Iterator[Text]:
    """Yield the strings of code, except inputs and expected outputs."""
    for path, nodes in trees():
        if not str(path.relative_to(ROOT)).startswith(PAYLOADS):
            yield from (Text(path, line, text) for line, text in literals(nodes))


def _codes() -> Iterator[Text]:
    for path in (ROOT / "harness" / "records").glob("*.toml"):
        for table in tomllib.loads(path.read_text()).values():
            yield from (Text(path, 0, table[key]) for key in ("title", "cause", "remedy"))


def _templates() -> Iterator[Text]:
    """Yield the lines of the report's pages and scripts, without tags and code."""
    report = ROOT / "harness" / "render" / "html"
    for path in sorted([*report.glob("pages/*.html"), *report.glob("script/*.js")]):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            shown = re.sub(r"\{%.*?%\}|<[^>]*>|\bclass: \"[^\"]*\"", " ", line)
            if path.suffix == ".js":
                quoted = re.findall(r"\"[^\"]*\"|`[^`]*`", shown)
                shown = " ".join(text for text in quoted if " " in text)
                shown = re.sub(r"\$\{.*?\}", "{}", shown)
            yield Text(path, number, re.sub(r"\{\{.*?\}\}", "{}", shown))


def names() -> Iterator[Text]:
    """Yield each name that is given outside a comprehension or a lambda."""
    for path, nodes in trees():
        short = {
            id(inner)
            for node in nodes
            if isinstance(node, ast.comprehension | ast.Lambda)
            for inner in ast.walk(node.target if isinstance(node, ast.comprehension) else node.args)
        }
        short |= {id(field) for node in nodes for field in _idiomatic(node)}
        for node in nodes:
            name = _given(node)
            if name and id(node) not in short:
                yield Text(path, getattr(node, "lineno", 1), name)


PREPOSITIONS = {"at", "of"}


def _idiomatic(node: ast.AST) -> Iterator[ast.AST]:
    """Yield fields and methods of a class whose names are plain English where users write them.

    A call of a public declaration reads as a phrase: `Equilibrium("rest", at={x: 0})`. The terms of
    an equation are called terms.
    """
    if not isinstance(node, ast.ClassDef):
        return
    for inner in node.body:
        target = inner.target if isinstance(inner, ast.AnnAssign) else inner
        name = _given(target)
        is_term_list = isinstance(inner, ast.AnnAssign) and "Term" in ast.unparse(inner.annotation)
        if (name in PREPOSITIONS and node.name in exported()) or (name == "terms" and is_term_list):
            yield target


@lru_cache(maxsize=1)
def exported() -> frozenset[str]:
    """Return the names that `physics_crosscheck` and its modules export."""
    files = (ROOT / "physics_crosscheck").glob("*.py")
    nodes = (node for file in files for node in ast.walk(ast.parse(file.read_text())))
    return frozenset(
        name.name for node in nodes if isinstance(node, ast.ImportFrom) for name in node.names
    )


def _given(node: ast.AST) -> str | None:
    """Return the name that a node gives to something."""
    match node:
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            return name
        case ast.arg(arg=name):
            return name
        case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
            return name
    return None


def _offence(text: Text, what: str) -> Offence:
    """Place an offence in code."""
    return Offence(room(text.path), f"{text.path.relative_to(ROOT)}:{text.line}", what)


def prose_words() -> Iterator[Offence]:
    """Yield banned phrases of pages."""
    for page, line, text in pages(*PAGES):
        for phrase in banned(text):
            yield Offence(page, f"{page}:{line}", phrase)


def prose_sentences() -> Iterator[Offence]:
    """Yield sentences of more than 25 words in the documentation."""
    for page, line, text in pages(*DOCS):
        if not text.startswith(("|", "<")):
            for sentence in sentences(text):
                if words(sentence) > MOST_WORDS:
                    yield Offence(page, f"{page}:{line}", f"{words(sentence)} words: {sentence}")


def table_cells() -> Iterator[Offence]:
    """Yield table cells of more than 15 words in the documentation."""
    for page, line, text in pages(*DOCS):
        for cell in text.split("|") if text.startswith("|") else ():
            if words(re.sub(r"\bcode\b", "", cell)) > MOST_CELL_WORDS:
                yield Offence(page, f"{page}:{line}", f"{words(cell)} words: {cell.strip()}")


def message_words() -> Iterator[Offence]:
    """Yield banned phrases of messages, help texts and the report."""
    for text in messages():
        for phrase in banned(text.text):
            yield _offence(text, f"{phrase}: {text.text.strip()}")


def message_sentences() -> Iterator[Offence]:
    """Yield sentences of more than 25 words in messages, help texts and the report."""
    for text in messages():
        if text.path.suffix == ".py" and "\n" not in text.text:
            for sentence in re.split(r"[.;] ", text.text):
                if words(sentence.replace("{}", "x")) > MOST_WORDS:
                    yield _offence(text, f"{words(sentence)} words: {sentence}")


def option_help() -> Iterator[Offence]:
    """Yield help texts of more than 12 words beside the default in brackets."""
    for path, nodes in trees():
        for node in nodes:
            if isinstance(node, ast.keyword) and node.arg == "help":
                for line, text in literals(list(ast.walk(node.value))):
                    count = words(re.sub(r"\([^)]*\)|\[[^]]*\]", "", text))
                    if count > MOST_HELP_WORDS:
                        yield _offence(Text(path, line, text), f"{count} words: {text}")


def docstring_words() -> Iterator[Offence]:
    """Yield banned phrases of docstrings."""
    for text in docstrings():
        for phrase in banned(text.text):
            yield _offence(text, phrase)


def docstring_first_words() -> Iterator[Offence]:
    """Yield docstrings that begin with no verb."""
    for text in docstrings():
        if first_word_is_wrong(text.text, function=text.function):
            yield _offence(text, text.text.strip().splitlines()[0])


def identifiers() -> Iterator[Offence]:
    """Yield banned names."""
    for text in names():
        if banned_name(text.text):
            yield _offence(text, text.text)


def class_names() -> Iterator[Offence]:
    """Yield classes, except those of tests, whose name is used before."""
    places: defaultdict[str, list[str]] = defaultdict(list)
    for path, nodes in trees():
        for node in nodes:
            if isinstance(node, ast.ClassDef) and room(path).partition("/")[0] != "tests":
                places[node.name].append(f"{path.relative_to(ROOT)}:{node.lineno}")
    for name, (first, *more) in places.items():
        yield from (Offence(name, place, f"{name}, as in {first}") for place in more)


RULES: Mapping[str, Rule] = {
    rule.__name__: rule
    for rule in (
        prose_words, prose_sentences, table_cells, message_words, message_sentences, option_help,
        docstring_words, docstring_first_words, identifiers, class_names,
    )
}  # fmt: skip


def pending(path: Path = PENDING) -> dict[str, dict[str, int]]:
    """Read what is not converted yet: by rule, the most offences that a room or page may have."""
    return tomllib.loads(path.read_text())


def faults(rule: str, offences: list[Offence], allowed: Mapping[str, int]) -> list[str]:
    """Return what a rule finds beyond the list, and the entries that are due for removal."""
    counts = Counter(offence.unit for offence in offences)
    over = {unit for unit, count in counts.items() if count > allowed.get(unit, 0)}
    excess = [f"{o.place}: {rule}: {o.text}" for o in offences if o.unit in over]
    clean = [unit for unit in allowed if not counts[unit]]
    return excess + [
        f"tests/language.toml: [{rule}] {unit} is clean; run `python -m tests.language`"
        for unit in clean
    ]


def shrunk(
    allowed: Mapping[str, Mapping[str, int]], counts: Mapping[str, Mapping[str, int]]
) -> dict[str, dict[str, int]]:
    """Return the lists with each count lowered to what is there; no entry is added or raised."""
    return {
        rule: {
            unit: min(most, counts[rule].get(unit, 0))
            for unit, most in units.items()
            if counts[rule].get(unit, 0)
        }
        for rule, units in allowed.items()
    }


def write(lists: Mapping[str, Mapping[str, int]], path: Path = PENDING) -> None:
    """Write the lists."""
    lines = [
        "# What is not converted to plain language yet; it only shrinks. See tests/language.py."
    ]
    for rule, units in lists.items():
        lines += ["", f"[{rule}]", *(f'"{unit}" = {units[unit]}' for unit in sorted(units))]
    path.write_text("\n".join(lines) + "\n")


def main() -> None:
    """Shrink the lists, and print how many offences are left by rule."""
    counts = {name: Counter(o.unit for o in rule()) for name, rule in RULES.items()}
    write(shrunk(pending(), counts))
    for name, units in counts.items():
        print(f"{name}: {units.total()}")
        if "-v" in sys.argv:
            print(*(f"  {o.place}: {o.text}" for o in RULES[name]()), sep="\n")


if __name__ == "__main__":
    main()
