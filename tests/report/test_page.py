"""The page: complete, safe, self-contained and reproducible."""

import html
import re
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.sweep import SweepRow
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.harness.render.html import render, unbroken, write_report
from physics_crosscheck.harness.render.html.maths import ELEMENTS, mathml
from physics_crosscheck.harness.render.html.sweep import Figures, tick_labels
from physics_crosscheck.records import Outcome, Results
from tests.report.page import Page
from tests.report.samples import results

HOSTILE = (
    "<script>alert(1)</script>", "</script><img src=http://evil.example/x onerror=alert(1)>",
    "\"><b onmouseover='alert(1)'>", "<!--<script>", "a\u202eb\x1b[31m\x00\ud800",
    "$$x$$ @@0 #010101", "{{ 7 * 7 }}{% raw %}", "]]>&lt;&amp;", "__proto__",
)  # fmt: skip


def drawn_with(base: Results, place: int, **shape: Any) -> Results:
    """Return results with one shape of the first system's sketch changed."""
    system = base.systems[0]
    assert system.sketch is not None
    shapes = list(system.sketch.shapes)
    shapes[place] = replace(shapes[place], **shape)
    sketch = replace(system.sketch, shapes=tuple(shapes))
    return replace(base, systems=(replace(system, sketch=sketch), *base.systems[1:]))


def hostile(name: str, base: Results) -> Results:
    """Return results with a hostile name in every text that a user may choose."""
    fixed = {
        "outcome",
        "created",
        "kind",
        "decided_by",
        "verdict",
        "folder",
        "latex",
        "unit",
        "number",
        "schema",
        "label",
        "put_into",
        "severity",
        "status",
        "changed",
    }

    def spoil(value: Any, key: str = "") -> Any:
        if key == "shapes":
            return value
        if isinstance(value, dict):
            return {k: spoil(v, k) for k, v in value.items()}
        if isinstance(value, (list, tuple)):
            return [spoil(v, key) for v in value]
        if not isinstance(value, str) or key in fixed or not value:
            return value
        return f"{value}{name}"

    spoiled = msgspec.convert(spoil(msgspec.to_builtins(base)), Results)
    return replace(spoiled, versions={f"{k}{name}": v for k, v in base.versions.items()})


def test_samples_are_valid_results(agreeing: Results, troubled: Results) -> None:
    for sample in (agreeing, troubled):
        assert decoded(encoded(sample).encode(), Results) == sample


def test_every_case_is_on_the_page_and_every_link_has_a_target(
    troubled_page: Page, troubled: Results
) -> None:
    ids = troubled_page.ids()
    assert len(ids) == len(set(ids))
    cases = [
        attrs
        for tag, attrs in troubled_page.elements
        if tag == "details" and attrs["class"] == "view case"
    ]
    assert len(cases) == len(troubled.cases)
    targets = [str(attrs["href"]) for tag, attrs in troubled_page.elements if tag == "a"]
    assert all(target.startswith("#") for target in targets)
    assert {target[1:] for target in targets} <= set(ids)
    assert {str(attrs["id"]) for attrs in cases} <= {target[1:] for target in targets}
    assert "case-system_0/mujoco.xml/mujoco/free" in ids


def test_every_sketch_is_drawn_and_described(page: Page) -> None:
    sketches = [attrs for tag, attrs in page.elements if tag == "svg"]
    assert len(sketches) == 2
    for attrs in sketches:
        assert "spring k" in str(attrs["aria-label"])
    shapes = [attrs for _, attrs in page.elements if "data-shape" in attrs]
    assert len(shapes) == 3 + 2 + 3 + 4


def test_every_view_has_numbers_where_it_has_plots(troubled_page: Page) -> None:
    wanted = {
        str(attrs["data-pack"]) for _, attrs in troubled_page.elements if "data-pack" in attrs
    }
    assert len([name for name in wanted if "case" in name]) == 16
    assert wanted <= set(troubled_page.packs)


@pytest.fixture(scope="module")
def spoiled(troubled: Results) -> Page:
    return Page(render(hostile("".join(HOSTILE), troubled)))


def test_names_and_messages_with_markup_are_escaped(spoiled: Page, troubled_page: Page) -> None:
    page = spoiled
    # Elements and attributes do not depend on the texts, so no text became markup.
    assert [(tag, set(attrs)) for tag, attrs in page.elements] == [
        (tag, set(attrs)) for tag, attrs in troubled_page.elements
    ]
    assert len(page.contents["script"]) == 2
    assert page.contents == troubled_page.contents
    page.source.encode()
    for name in HOSTILE:
        assert name in page.text or not name.isprintable()
    assert not re.search("[\x00-\x08\x0b-\x1f\u202a-\u202e\u2066-\u2069]", page.text)


def test_packed_numbers_stay_within_their_elements(spoiled: Page) -> None:
    element = r'<script type="text/plain"[^>]*>(.*?)</script>'
    contents = re.findall(element, spoiled.source, re.DOTALL)
    assert len(contents) == len(spoiled.packs) > 2
    for content in contents:
        assert re.fullmatch("[A-Za-z0-9+/=]+", content)


BAD_MATHS = (
    r"\text{<script>alert(1)</script>}", r"\href{javascript:alert(1)}{x}", r"\frac{x", "<b>x</b>",
    r"\text{</math><img src=x onerror=alert(1)>}", "<!DOCTYPE a [<!ENTITY b 'c'>]>&b;",
    r"\style{color:red}{x}", r"x \& <annotation-xml encoding='text/html'>", "\u202e\x1b\x00",
)  # fmt: skip


@pytest.mark.parametrize("bad", BAD_MATHS)
def test_mathematics_has_only_harmless_elements(bad: str) -> None:
    page = Page(mathml(bad))
    assert {tag for tag, _ in page.elements} <= ELEMENTS | {"math", "code"}
    assert not re.search("script|href|style|encoding", str([a for _, a in page.elements]))
    assert not re.search("[\x00-\x08\x0b-\x1f\u202a-\u202e\u2066-\u2069]", page.text)
    assert not re.search("<(script|img|b|annotation)", mathml(bad))


def test_mathematics_has_accents_and_escaped_text() -> None:
    markup = mathml("\\frac{\\dot{x}}{\\text{a<b\u202e}}", block=True)
    assert markup.startswith('<math display="block"><mfrac><mover accent="true"><mi>x</mi><mo')
    assert "˙" in html.unescape(markup)
    assert markup.endswith("a&lt;b⟨U+202E⟩</mtext></mfrac></math>")


def test_label_of_sketch_is_escaped() -> None:
    source = render(drawn_with(results(1), 3, label="<script>\u202e_<b>"))
    assert "&lt;script&gt;⟨U+202E⟩<tspan" in source
    assert ">&lt;b&gt;</tspan>" in source


def test_page_makes_no_external_requests(troubled_page: Page) -> None:
    loading = {
        "src",
        "srcset",
        "data",
        "poster",
        "background",
        "action",
        "formaction",
        "ping",
        "manifest",
    }
    for tag, attrs in troubled_page.elements:
        assert tag not in {
            "link",
            "img",
            "iframe",
            "object",
            "embed",
            "base",
            "audio",
            "video",
            "form",
        }
        assert not loading & set(attrs)
        assert str(attrs.get("href", "#")).startswith("#")
    for style in troubled_page.contents["style"]:
        assert not re.search(r"@import|url\(|image-set|@font-face", style)
    policy = next(
        attrs["content"] for tag, attrs in troubled_page.elements if "http-equiv" in attrs
    )
    assert str(policy).startswith("default-src 'none'; script-src 'sha256-")
    assert "http" not in str(policy).replace("http-equiv", "")


def test_same_results_give_the_same_page(agreeing: Results) -> None:
    assert render(agreeing) == render(decoded(encoded(agreeing).encode(), Results))


def test_results_without_any_case_make_a_page() -> None:
    assert "0 of 0 cases agree" in render(results(0))


def test_report_of_36_cases_is_below_two_megabytes(tmp_path: Path) -> None:
    sample = results(4)
    assert len(sample.cases) == 36
    write_report(tmp_path / "index.html", sample)
    assert (tmp_path / "index.html").stat().st_size < 2e6
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]


def test_failed_report_keeps_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> str:
        raise ValueError("not to be drawn")

    path = tmp_path / "index.html"
    path.write_text("old")
    monkeypatch.setattr("physics_crosscheck.harness.render.html._script", refuse)
    with pytest.raises(ValueError, match="not to be drawn"):
        write_report(path, results(1))
    assert path.read_text() == "old"


@pytest.mark.parametrize(
    ("values", "labels"),
    [
        ([1.0, 2.0], ["1", "2"]),
        ([0.1, 0.2, 0.1 + 0.2], ["0.1", "0.2", "0.3"]),
        ([1.5, 10.0, 120.0], ["1.5", "10", "120"]),
        ([1.2340, 1.2345, 1.2350], ["1.234", "1.2345", "1.235"]),
        ([1.0e-9, 1.5e-9, 2.0e-9], ["1.0×10⁻⁹", "1.5×10⁻⁹", "2.0×10⁻⁹"]),
        ([1e-12, 1e-9, 1e-6], ["10⁻¹²", "10⁻⁹", "10⁻⁶"]),
        ([0.0, 1e5], ["0", "10⁵"]),
    ],
)
def test_ticks_are_exact_and_short(values: list[float], labels: list[str]) -> None:
    assert tick_labels(values) == labels


def test_number_with_exponent_stays_on_one_line() -> None:
    text = str(unbroken("<b> ends 1.2e-10 off, rod-3e-4x"))
    assert text.startswith("&lt;b&gt; ends ")
    assert '<span class="unbroken">1.2e-10</span> off' in text


def test_parallel_coordinates_have_a_line_for_each_case_and_mark_differences() -> None:
    def row(i: int, k: float, error: float | None, outcome: Outcome) -> SweepRow:
        return SweepRow(
            index=i, draw=i, system="s", model="m.xml", engine="e", scenario="free",
            integrator="euler", constants={"k": k, "c": 1.0 + i}, outcome=outcome,
            global_error=error, command="",
        )  # fmt: skip

    rows = [
        row(0, 2.0, 0.01, Outcome.DIFFERS),
        row(1, 1.0, 0.1, Outcome.AGREES),
        row(2, 3.0, None, Outcome.AGREES),
    ]
    figures = Figures(system="s", rows=rows, names=["k", "c"])
    cases = figures.cases(["k", "c"])
    assert [row.outcome for row, _ in cases] == ["AGREES", "DIFFERS"]
    shares = [
        [axis.share(value) for axis, value in zip(figures.axes(cases), values, strict=True)]
        for _, values in cases
    ]
    assert shares[0][0] < shares[1][0], "a larger k is higher"
    assert shares[0][1] > shares[1][1]
    assert shares[0][2] > shares[1][2]
    assert Figures(system="s", rows=rows[2:], names=["k"]).pictures == []
