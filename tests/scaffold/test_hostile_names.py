"""Names and texts of a model file become strings only, never code."""

import ast
import os
import tomllib
from contextlib import suppress
from html import escape
from pathlib import Path

import mujoco
import pytest

from physics_crosscheck import MultibodySystem
from physics_crosscheck.harness.commands.scaffold.folder import NewError
from physics_crosscheck.harness.commands.scaffold.from_model import from_model
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.reference.load import load_declaration

CODE = 'open("PWNED","w")'
NAMES = (
    f'a"""+str({CODE})+"""c', f"a'''+str({CODE})+'''c", f'a"+str({CODE})+"c', f"a' + {CODE} + 'c",
    'ends with a backslash\\', '\\"""', "{" + CODE + "}", "{{x}}", "%s%n", "${x}", "`x`", "#[[",
    "new\nline", "carriage\rreturn", "tab\tstop", "u2028\u2028" + CODE, "next\x85line",
    "\u202ebidi",
    "E", "I", "N", "S", "lambda", "None", "__import__('os')", "__class__", "sin", "pi", "t", "T",
    "system", "ground", "a.b", "left arm", "a - b", "é", "\U0001f916", "]]\n[settings]\nstep = 1",
    '"""', "'''", "<b>&amp;", "::error::x", "x" * 300, "-", ".", "print(1)", "q1; import os",
)  # fmt: skip
"""Names of joints and links, mesh paths and more; those that XML can hold."""

URDF = """<robot name="{name}"><!-- {comment} -->
<link name="floor"/><link name="{name}"><inertial><origin xyz="0 0 -0.5"/><mass value="1.5"/>
<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{name}" type="continuous"><parent link="floor"/><child link="{name}"/>
<axis xyz="0 1 0"/><dynamics damping="0.1"/></joint></robot>
"""
MJCF = """<mujoco model="{name}"><!-- {comment} --><compiler angle="radian"/>
<default><default class="{name}"><joint damping="0.1"/></default></default><worldbody>
<body name="{name}"><joint name="{name}" class="{name}" axis="0 1 0"/>
<inertial pos="0 0 -0.5" mass="1.5" diaginertia="0.02 0.02 0.02"/></body></worldbody></mujoco>
"""


def attribute(text: str) -> str:
    """Return text for an attribute, with references for unprintable characters."""
    return "".join(c if c.isprintable() else f"&#{ord(c)};" for c in escape(text))


def strings_and_code(source: str) -> tuple[list[str], str]:
    """Return the strings of a module, and its syntax tree without them."""
    tree = ast.parse(source)
    strings = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            strings.append(node.value)
            node.value = ""
    return strings, ast.dump(tree)


@pytest.fixture(autouse=True)
def working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Change to an empty folder, in which executed code would create a file."""
    monkeypatch.chdir(tmp_path)
    # Skip engines, which are slow.
    monkeypatch.setattr(
        "physics_crosscheck.harness.commands.scaffold.from_tree._run", lambda *_: ({}, [])
    )


@pytest.mark.parametrize(("text", "ending", "name"), [
    *((URDF, "urdf", name) for name in NAMES), *((MJCF, "xml", name) for name in NAMES[::4]),
])  # fmt: skip
def test_names_in_a_file_become_strings_only(
    tmp_path: Path, text: str, ending: str, name: str
) -> None:
    model = tmp_path / f"model.{ending}"
    comment = "".join(c for c in name if c.isprintable()).replace("--", "")
    model.write_text(text.format(name=attribute(name), comment=comment), encoding="utf-8")
    with suppress(NewError):
        from_model(model, tmp_path / "made")
    if not (tmp_path / "made").exists():
        # MuJoCo rejects some names; then nothing is written.
        assert ending == "xml"
        return
    assert "PWNED" not in os.listdir(tmp_path)
    strings, _ = strings_and_code((tmp_path / "made" / "system.py").read_text(encoding="utf-8"))
    assert name in strings
    system = load_declaration(tmp_path / "made")
    assert isinstance(system, MultibodySystem)
    assert [link.name for link in system.assembled.tree.links] == [name]
    read_sidecar(tmp_path / "made" / f"model.{ending}.toml")
    assert "PWNED" not in os.listdir(tmp_path)


def make_chain(urdf: bool) -> tuple[list[str], str]:
    """Return the names of links and joints of a long chain of bodies, and its text."""
    if urdf:
        texts = [URDF.format(name=attribute(name), comment="") for name in NAMES]
        joined = [text[text.index("<link name", text.index("/>")) : text.index("</robot>")]
                  for text in texts]  # fmt: skip
        for i in range(1, len(joined)):
            joined[i] = joined[i].replace(
                'parent link="floor"', f'parent link="{attribute(NAMES[i - 1])}"'
            )
        return list(NAMES), f'<robot name="r"><link name="floor"/>{"".join(joined)}</robot>'
    names = [name for name in NAMES if is_read_by_mujoco(name)]
    bodies = [MJCF[MJCF.index("<body") : MJCF.index("</body>")].format(name=attribute(name))
              .replace(f'class="{attribute(name)}" ', "") for name in names]  # fmt: skip
    motors = "".join(f'<motor name="{attribute(n)}" joint="{attribute(n)}"/>' for n in names)
    return names, (
        f"<mujoco><worldbody>{''.join(bodies)}{'</body>' * len(bodies)}</worldbody>"
        f"<actuator>{motors}</actuator></mujoco>"
    )


def is_read_by_mujoco(name: str) -> bool:
    with suppress(ValueError):
        text = MJCF.format(name=attribute(name), comment="")
        return bool(mujoco.MjModel.from_xml_string(text).body(1).name == name)
    return False


@pytest.mark.parametrize("ending", ["urdf", "xml"])
def test_names_of_bodies_become_strings_only(tmp_path: Path, ending: str) -> None:
    names, text = make_chain(ending == "urdf")
    assert len(names) > len(NAMES) / 2
    model = tmp_path / f"model.{ending}"
    model.write_text(text, encoding="utf-8")
    from_model(model, tmp_path / "made")
    strings, _ = strings_and_code((tmp_path / "made" / "system.py").read_text(encoding="utf-8"))
    assert set(names) <= set(strings)
    system = load_declaration(tmp_path / "made")
    assert isinstance(system, MultibodySystem)
    assert [link.name for link in system.assembled.tree.links] == names
    read_sidecar(tmp_path / "made" / f"model.{ending}.toml")
    assert "PWNED" not in os.listdir(tmp_path)


def test_name_of_a_file_becomes_a_string_only(tmp_path: Path) -> None:
    trees = set()
    hostile = [name for name in NAMES if not name.isprintable() or set(name) & set("\"'\\{`#")]
    for i, name in enumerate(("plain", *hostile)):
        model = tmp_path / f"{name.replace('/', '_')[:200]}.urdf"
        model.write_text(URDF.format(name="joint", comment=""))
        folder = tmp_path / f"made_{i}"
        if not name.isprintable():
            with pytest.raises(NewError, match=r"^[^\n]*; rename it$"):
                from_model(model, folder)
            continue
        from_model(model, folder)
        _, code = strings_and_code((folder / "system.py").read_text(encoding="utf-8"))
        # The code is the same for every name; only strings and comments differ.
        trees.add(code)
        tomllib.loads((folder / f"{model.name}.toml").read_text(encoding="utf-8"))
        load_declaration(folder)
        assert "PWNED" not in os.listdir(tmp_path)
    assert len(trees) == 1


def test_file_name_that_is_not_utf8_is_refused(tmp_path: Path) -> None:
    model = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe.urdf"))
    model.write_text(URDF.format(name="joint", comment=""))
    with pytest.raises(NewError, match="bytes that are not UTF-8; rename it"):
        from_model(model, tmp_path / "made")


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "1e999"])
def test_number_that_is_not_finite_is_refused(tmp_path: Path, number: str) -> None:
    model = tmp_path / "model.urdf"
    text = URDF.format(name="joint", comment="")
    for plain in ('mass value="1.5"', 'damping="0.1"', 'xyz="0 0 -0.5"', 'axis xyz="0 1 0"'):
        old = plain.split('"')[1].split()[-1]
        model.write_text(text.replace(plain, plain.replace(old, number)))
        with pytest.raises(NewError, match=r"model\.urdf:\d+: .*number"):
            from_model(model, tmp_path / "made")


@pytest.mark.parametrize("mesh", ["space.py", "space.py.toml", "meshes/system.py", "a.pyc"])
def test_mesh_does_not_become_code_of_the_folder(tmp_path: Path, mesh: str) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / mesh).write_text(CODE)
    model = tmp_path / "model.urdf"
    geometry = f'<visual><geometry><mesh filename="{mesh}"/></geometry></visual></link>'
    model.write_text(URDF.format(name="joint", comment="").replace("</link>", geometry, 1))
    from_model(model, tmp_path / "made")
    names = {str(path.relative_to(tmp_path / "made")) for path in (tmp_path / "made").rglob("*")}
    assert names == {"model.urdf", "model.urdf.toml", "system.py"}
    assert CODE not in (tmp_path / "made" / "system.py").read_text()


def test_mesh_that_is_a_pipe_is_not_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "mesh.stl")
    model = tmp_path / "model.urdf"
    geometry = '<visual><geometry><mesh filename="mesh.stl"/></geometry></visual></link>'
    model.write_text(URDF.format(name="joint", comment="").replace("</link>", geometry, 1))
    with pytest.raises(NewError, match="is a named pipe; expected a file"):
        from_model(model, tmp_path / "made")
