"""Output of `crosscheck derive`: complete and computed, for terminals and LaTeX."""

import dataclasses
import re
import time
from functools import cache
from pathlib import Path
from typing import Literal
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import DeclarationError, Equilibrium, MultibodySystem, System
from physics_crosscheck.harness.checks.derivation import derivation, tree_derivation
from physics_crosscheck.harness.commands.scaffold.from_model import from_model
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_bodies
from physics_crosscheck.harness.render.html.maths import mathml
from physics_crosscheck.harness.render.terminal.equations import DerivedPage, describe
from physics_crosscheck.reference.load import load_declaration, load_system
from tests.cases.arms import arm
from tests.reference.mechanisms import CART

MODELS = Path(__file__).parents[2] / "models"
NAMES = sorted(path.parent.name for path in MODELS.glob("*/system.py"))
Style = Literal["text", "latex"]
STYLES: list[Style] = ["text", "latex"]


@cache
def system_of(name: str) -> System:
    return load_system(MODELS / name)


@cache
def derived(name: str) -> DerivedPage:
    return derivation(system_of(name))


@cache
def page(name: str, style: Style = "text") -> str:
    return describe(derived(name), style)


def squeeze(text: str) -> str:
    """Return a page without the breaks and blanks of its layout."""
    return re.sub(r"\s+", " ", text)


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("name", NAMES)
def test_page_names_declared_parts(name: str, style: Style) -> None:
    system, text = system_of(name), squeeze(page(name, style))
    assert system.title in text
    assert system.source in text
    descriptions = [coordinate.description for coordinate in system.coordinates]
    descriptions += [given.description for given in system.inputs]
    descriptions += [constant.description for constant in system.constants]
    for description in descriptions:
        assert description in text
    for constant in system.constants:
        assert constant.source in text.replace(r"\textasciicircum{}", "^")
        assert f"{constant.value:.6g}" in text
    for equilibrium in system.equilibria:
        assert f"Equilibrium {equilibrium.name}: {equilibrium.description}" in text
    for published in system.published:
        assert f"Eq. {published.number}" in text


@pytest.mark.parametrize("name", NAMES)
def test_text_fits_100_columns(name: str) -> None:
    assert max(map(len, page(name).splitlines())) <= 100
    assert not re.search(r"[ \t]$", page(name), re.MULTILINE)


@pytest.mark.parametrize("name", NAMES)
def test_text_has_no_internal_names(name: str) -> None:
    text = page(name)
    assert "_dot" not in text
    assert "_ddot" not in text
    assert "_deviation" not in text
    assert "**" not in text
    assert not re.search(r"\bnan\b|\binf\b|-0(?![.\d])|Float|Matrix", text)


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("mass_spring_damper", [
            "m*x'' = -c*x' - k*x + f",
            "SISO, linear.",
            "x/f = 1 / (m*s^2 + c*s + k)",
            f"{np.sqrt(47 / 1.3):.6g}",
            f"{np.sqrt(47 / 1.3) / (2 * np.pi):.6g}",
            f"{0.9 / (2 * np.sqrt(47 * 1.3)):.6g}",
            f"-{0.9 / 2.6:.6g} ±",
            "Eq. 2.5 motion of x: agrees up to signs",
            "Eq. 2.6 motion of x: agrees ",
        ]),
        ("torsional_disc", [
            "J*theta'' = -k_theta*theta + T",
            f"{np.sqrt(0.85 / 0.021):.6g}",
            "theta/T = 1 / (J*s^2 + k_theta)",
        ]),
        ("free_pair", [
            "SIMO, linear.",
            "0 0 0 2 rigid body",
            "0 0 1 1 rigid body",
            "x2/f = (c*s + k) / (m1*m2*s^4 + c*(m1 + m2)*s^3 + k*(m1 + m2)*s^2)",
            "1 of 17 differs",
            "Eq. 2.25 motion of x2: differs",
            "left over k*x1 - k*x2",
        ]),
        ("anchored_pair", [
            "SIMO, linear.",
            "Modes with damping",
            "x1/f = c*s / (m1*m2*s^4 + c*(m1 + m2)*s^3 + (k1*m2 + k2*m1)*s^2 + c*(k1 + k2)*s"
            " + k1*k2)",
        ]),
        ("drum_pendulum", [
            "MIMO, nonlinear.",
            "(3*M/2 + m)*x'' + l*m*cos(theta)/2*theta'' = -k*x + l*m*theta'^2*sin(theta)/2 + F",
            "theta = pi",
            "dtheta = theta - pi",
            "grows, 5.18574 1/s",
            "upright: unstable",
            "Eq. 3.14 linear about hanging: agrees",
        ]),
        ("simple_pendulum", [
            "l^2*m*theta'' + g*l*m*theta - g*l*m/6*theta^3 = tau",
            "l^2*m*theta'' - g*l*m*dtheta + g*l*m/6*dtheta^3 = tau",
            f"{np.sqrt(9.81 / 0.75):.6g}",
            "0.01 0.00297 %",
            "none of 11 differs",
        ]),
    ],
)  # fmt: skip
def test_text_has_computed_values(name: str, lines: list[str]) -> None:
    text = squeeze(page(name))
    for line in lines:
        assert line in text


def test_changed_constant_changes_the_numbers() -> None:
    system = system_of("mass_spring_damper")
    m, c, k = system.constants
    stiffer = dataclasses.replace(system, constants=(m, c, dataclasses.replace(k, value=48.0)))
    assert f"{np.sqrt(48 / 1.3):.6g}" in describe(derivation(stiffer))
    assert f"{np.sqrt(47 / 1.3):.6g}" not in describe(derivation(stiffer))


def test_planted_erratum_is_counted() -> None:
    system = system_of("mass_spring_damper")
    first, second = (entry for entry in system.published if entry.number in ("2.5", "2.6"))
    wrong = dataclasses.replace(second, text="m*x'' + 2*c*x' + k*x = f")
    text = squeeze(describe(derivation(dataclasses.replace(system, published=(first, wrong)))))
    assert "1 of 2 differs" in text
    assert "Eq. 2.6 motion of x: differs" in text
    assert "left over c*x'" in text


def test_linear_system_has_no_taylor_series() -> None:
    text = page("mass_spring_damper")
    assert "Taylor" not in text
    assert "How far" not in text
    assert "Taylor" in page("simple_pendulum")


def test_system_without_inputs_is_described() -> None:
    system = system_of("simple_pendulum")
    free = dataclasses.replace(
        system, inputs=(), scenarios=(dataclasses.replace(system.scenarios[0], inputs={}),)
    )
    text = squeeze(describe(derivation(free)))
    assert "autonomous, nonlinear. Inputs: none. Outputs: theta." in text
    assert "Transfer functions" not in text


def test_wrong_equilibrium_is_rejected() -> None:
    system = system_of("simple_pendulum")
    off = Equilibrium("off", {system.coordinates[0]: 1}, False, "none")
    with pytest.raises(DeclarationError, match="'off': is not an equilibrium"):
        derivation(dataclasses.replace(system, equilibria=(off,)))


@pytest.mark.slow
def test_arm_with_two_joints_is_printed_within_seconds() -> None:
    """Print a 2 x 2 mass matrix that is too long to invert or expand symbolically."""
    began = time.process_time()
    text, latex = (describe(found, style) for found in [derivation(arm())] for style in STYLES)
    assert time.process_time() - began < 30
    assert "M = [ 0.0206602    0.000446292 ]" in text
    assert "A = [ 0        0         1         0        ]" in text
    assert "C = [ friction  0        ] = [ 0.4  0   ]" in text
    assert "Left out: of equations as long as these it would fill pages." in text
    assert "lift/torque = (13.6035*s^2" in text
    assert r"\ddot{\text{pan}}" in latex
    environments(latex)


@pytest.mark.slow
def test_three_coordinates_with_short_equations_are_symbolic() -> None:
    text = describe(derivation(CART))
    assert "l1*m1 + l1*m2" in text
    assert "-1/(l1*m0)" in text, "B, of the inverse mass matrix"
    assert "e-6" not in text, "rounding errors are dropped"


# LaTeX


def environments(text: str) -> None:
    """Fail unless every environment is closed, in its order."""
    opened: list[str] = []
    for kind, name in re.findall(r"\\(begin|end)\{([a-z*]+)\}", text):
        if kind == "begin":
            opened.append(name)
        else:
            assert opened.pop() == name
    assert not opened


@pytest.mark.parametrize("name", NAMES)
def test_latex_is_balanced(name: str) -> None:
    text = page(name, "latex")
    environments(text)
    depth = 0
    for sign in re.sub(r"\\[{}]", "", text):
        depth += {"{": 1, "}": -1}.get(sign, 0)
        assert depth >= 0
    assert depth == 0
    assert text.count(r"\left(") == text.count(r"\right)")
    assert len(re.findall(r"(?<!\\)\$", text)) % 2 == 0
    assert text.count(r"\[") == text.count(r"\]")


@pytest.mark.parametrize("name", NAMES)
def test_latex_rows_have_as_many_cells_as_columns(name: str) -> None:
    tables = re.findall(
        r"\\begin\{tabular\}\{((?:l|p\{[^}]*\})+)\}\n(.*?)\n\\end\{tabular\}",
        page(name, "latex"),
        re.DOTALL,
    )
    assert len(tables) == page(name, "latex").count(r"\begin{tabular}")
    for columns, body in tables:
        count = len(re.sub(r"p\{[^}]*\}", "l", columns))
        for row in body.splitlines():
            assert len(re.findall(r"(?<!\\)&", row)) == count - 1
            # LaTeX reads a bracket at the start of a row as spacing of the row above.
            assert not row.startswith("[")


@pytest.mark.parametrize("name", NAMES)
def test_latex_has_no_raw_specials_or_internal_names(name: str) -> None:
    text = page(name, "latex")
    outside = re.sub(
        r"\$[^$]*\$|\\\[.*?\\\]|\\begin\{align\*\}.*?\\end\{align\*\}", "", text, flags=re.DOTALL
    )
    assert not re.search(r"(?<!\\)[_^#%]", outside)
    assert "±" not in text
    assert "''" not in text
    assert "ddot}" not in text.replace(r"\ddot{", "")
    assert "deviation" not in outside or "deviations" in outside
    assert text.isascii()


@pytest.mark.parametrize(
    ("name", "formulas"),
    [
        ("mass_spring_damper", [
            r"m \, \ddot{x} &= -c \dot{x} - k x + f",
            r"\frac{x}{f} &= \frac{1}{m \, s^{2} + c \, s + k}",
            r"\pm 6.00283 \mathrm{j}",
            r"$f \pm k x \pm c \dot{x} = m \ddot{x}$",
        ]),
        ("torsional_disc", [r"J \ddot{\theta} + k_{\theta} \theta = T"]),
        ("free_pair", [
            r"$d /d t(d L/d \dot{x}_{1}) = m_{1} \ddot{x}_{1}$",
        ]),
        ("drum_pendulum", [
            r"\Delta_{\theta} &= \theta - \pi",
            r"(m l/2) \ddot{x} \cos(\theta)",
        ]),
    ],
)  # fmt: skip
def test_latex_has_computed_values(name: str, formulas: list[str]) -> None:
    text = page(name, "latex")
    for formula in formulas:
        assert formula in text


def test_special_characters_are_escaped() -> None:
    system = system_of("mass_spring_damper")
    m, c, k = system.constants
    odd = dataclasses.replace(m, description=r"50 % of m_1 & {more} \ #2 ~ $")
    text = describe(derivation(dataclasses.replace(system, constants=(odd, c, k))), "latex")
    assert r"50 \% of m\_1 \& \{more\} \textbackslash  \#2 \textasciitilde{} \$" in text
    environments(text)


@pytest.mark.parametrize("name", NAMES)
def test_every_formula_converts_to_mathml(name: str) -> None:
    text = page(name, "latex")
    aligned = re.findall(r"\\begin{align\*}\n(.*?)\n\\end{align\*}", text, re.DOTALL)
    formulas = [line.replace("&", "") for lines in aligned for line in lines.split(" \\\\\n")]
    formulas += re.findall(r"\\\[\n(.*?)\n\\\]", text, re.DOTALL)
    formulas += re.findall(r"\$(.+?)\$", text)
    assert len(formulas) > 20
    for formula in formulas:
        assert mathml(formula).startswith("<math>"), formula
        fromstring(mathml(formula))


SWINGING = """<robot name="two"><link name="l0"/>{}</robot>"""
LIMB = """<link name="l{1}"><inertial><origin xyz="0.02 0 -0.1"/><mass value="1.{0}"/>
<inertia ixx="0.1" iyy="0.11" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j{0}" type="continuous"><parent link="l{0}"/><child link="l{1}"/>
<origin xyz="0 0 -0.2"/><axis xyz="0 1 0"/><dynamics damping="0.1"{2}/></joint>"""


def folder_of(path: Path, friction: str) -> Path:
    model = path / "two.urdf"
    model.write_text(SWINGING.format("".join(LIMB.format(i, i + 1, friction) for i in (0, 1))))
    from_model(model, path / "two")
    return path / "two"


FOLDER = """from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Scenario, System, ground)
a, b = (Coordinate(name, "rad", name) for name in "ab")
m, g, x, c, l, j, k, n = numbers = tuple(
    Constant(name, value, unit, name, "x") for name, value, unit in (
        ("m", 1.1, "kg"), ("g", 9.81, "m/s^2"), ("x", 0.02, "m"), ("c", 0.1, "m"),
        ("l", 0.2, "m"), ("j", 0.1, "kg*m^2"), ("k", 0.11, "kg*m^2"), ("n", 0.05, "kg*m^2")))
first = ground.hinge(a, about=(0, 1, 0))
rods = first.at(x, 0, -c), first.at(0, 0, -l).hinge(b, about=(0, 1, 0)).at(x, 0, -c)
u = Input("u", "N*m", "u", on={a: 1})
system = System(
    name="two", title="two", source="x", coordinates=(a, b), constants=numbers, inputs=(u,),
    outputs=(Output("a", a.q, "rad", "a"),), published=(), D=0,
    T=sum(rod.kinetic(m, (j, k, n)) for rod in rods),
    V=sum(rod.weight(m, (0, 0, -g)) for rod in rods),
    equilibria=(Equilibrium("rest", at={a: 0.2, b: 0}, search=True, description="rest"),),
    scenarios=(Scenario("s", "s", q={a: 0, b: 0}, v={a: 0, b: 0}, inputs={u: 0}, duration=1),))
"""


@pytest.mark.slow
def test_equilibrium_at_irregular_angle_is_inverted_numerically(tmp_path: Path) -> None:
    """Invert short matrices with searched digits, which sympy would factor endlessly."""
    (tmp_path / "system.py").write_text(FOLDER)
    equations = derivation(load_system(tmp_path))
    matrices = {matrix.name: matrix for matrix in equations.values["equilibria"][0]["matrices"]}
    assert matrices["M"].symbolic is not None
    assert matrices["M"].symbolic.has(sp.Float)
    assert matrices["A"].symbolic is None
    mass, stiffness = (np.array(matrices[name].numbers) for name in "MK")
    below = np.array(matrices["A"].numbers)[2:, :2]
    np.testing.assert_allclose(mass @ below, -stiffness, rtol=1e-12)


def test_two_bodies_are_printed_as_formulas(tmp_path: Path) -> None:
    declared = load_declaration(folder_of(tmp_path, ' friction="0.1"'))
    assert isinstance(declared, MultibodySystem)
    text, latex = (
        describe(found, style) for found in [tree_derivation(declared)] for style in STYLES
    )
    assert "(0.0088*sin(j1) + 0.044*cos(j1) + 0.28584)*j0''" in text
    assert "- 0.1*j1'" in text
    assert "M = [ 0.32984  0.14344 ]" in text
    assert max(map(len, text.splitlines())) <= 100
    assert r"\ddot{j}_{0}" in latex
    assert r"\begin{bmatrix} 0.32984 & 0.14344 \\" in latex


def test_seven_joints_are_printed_as_numbers_with_a_note(tmp_path: Path) -> None:
    pybullet_data = pytest.importorskip("pybullet_data", reason="comes with PyBullet")
    kuka = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
    from_model(kuka, tmp_path / "kuka")
    declared = load_declaration(tmp_path / "kuka")
    assert isinstance(declared, MultibodySystem)
    equations = tree_derivation(declared)
    for text in (describe(equations, style) for style in STYLES):
        assert "they are left out: they are too long for 7 joints" in text
        assert "Degrees of freedom: 7." in text
        rows = re.findall(r"lbr_iiwa_link_3|lbr\\_iiwa\\_link\\_3", text)
        assert len(rows) == 3  # its mass, its load and its joint
        assert "e-15" not in text
        assert r"\times 10^{-15}" not in text  # rounding errors of rotated axes


@pytest.mark.parametrize("width", [60, 80, 120])
def test_text_fits_the_terminal_without_truncated_words(
    width: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seven columns of a mass matrix are wider than sixty characters, and printed in parts."""
    links = "".join(
        f'<link name="l{i}"><inertial><origin xyz="0.01 0.02 -0.1"/><mass value="1.3"/><inertia '
        'ixx="0.021" iyy="0.018" izz="0.006" ixy="0.001" ixz="0" iyz="0"/></inertial></link>'
        for i in range(8)
    )
    joints = "".join(
        f'<joint name="j{i}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<origin xyz="0 0.1 -0.2"/><axis xyz="0 {i % 2} 0.3"/></joint>'
        for i in range(7)
    )
    monkeypatch.chdir(tmp_path)
    file = Path("arm.urdf")
    file.write_text(f'<robot name="arm">{links}{joints}</robot>')
    equations = tree_derivation(robot_bodies(read_robot(file)))
    lines = describe(equations, "text", width).splitlines()
    assert max(map(len, lines)) <= width
    wide = describe(equations, "text", 400)
    words = {word for word in wide.split() if set(word) - {"-", "="}}
    assert words - set(" ".join(lines).split()) <= {"M"}
    assert ("M, columns 1 to" in " ".join(lines)) is (width < 120)
