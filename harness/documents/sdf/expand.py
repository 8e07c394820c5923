"""One SDFormat file for each moving model of a file that has several, or includes or nests others.

A model whose links joints don't connect counts as several: `m`, and `m.link` for each further part.

A copy has a line for each element, whose line in the file or its include is noted. A nested model
becomes a frame of its name, and its links, joints and frames get names such as `arm__link`, by the
format's pose semantics (http://sdformat.org/tutorials?tut=composition).
"""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ..document import Document
from ..elements import XmlElement
from ..errors import LocationError
from ..expanded import LEVELS, cached_copy, package_folders, write_copy
from .frames import MODEL, NAMED, WORLD
from .read import is_static, version

_ROOTS = ("sdf", "gazebo")
"""Tags of a file's root; the second is that of old files."""

_REFERENCES = ("relative_to", "attached_to", "expressed_in")
_PATHS = (
    "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "SDF_PATH",
)  # fmt: skip
"""Environment variables with folders of models."""

_ODD = re.compile(r"[^-.\w]")
_NESTING = (1, 7)
"""First version whose poses can be relative to a nested model's frame."""

_DEPTH = 20
"""Most includes within each other."""


def sdf_models(source: Path) -> dict[str, Path]:
    """Return a file for each moving model, by its name; none if the file needs no copy.

    Models are those of the file, and of files beside it that it includes: by a path, a
    ROS package, or `model://NAME` in a folder above, in its `models`, or in the paths of the
    environment. Models that joints of the world connect become one.
    """
    try:
        document = Document(source)
    except LocationError:
        return {}
    if document.root.tag not in _ROOTS:
        return {}
    root = XmlElement("sdf", dict(document.root.attributes))
    for child in document.root:
        root.append(child.copy())
    holders = [root, *root.findall("world")]
    versions = {id(one): root.get("version") for one in holders}
    changed = [_include(one, source, versions, 0) for one in holders]
    if version(document) >= _NESTING:
        changed += [_connect(one) for one in holders[1:]]
    moving = [(a, b) for a in holders for b in a.findall("model") if not is_static(b)]
    changed += [_flatten(model) for _, model in moving if _is_new(versions, model, document)]
    for each in moving:
        versions.setdefault(id(each[1]), root.get("version"))
    moving = [(holder, part) for holder, one in moving for part in _split(holder, one, versions)]
    if not moving or not (any(changed) or len(moving) > 1 or document.root.tag != "sdf"):
        return {}
    files = {}
    for holder, model in moving:
        name = model.get("name")
        word = f".{_ODD.sub('_', name)}" if len(moving) > 1 else ""
        copy = _single_model(root, holder, model, versions)
        _absolute(copy, source)
        files[name] = cached_copy(source, [name], f"{source.stem}{word}.sdf", "sdf")
        marks = list(_marks(copy, (str(source), 1)))
        write_copy(source, files[name], "\n".join(_lines(copy)).encode(), marks)
    return files


def _is_new(versions: dict[int, str], model: XmlElement, document: Document) -> bool:
    return _has_frames(versions.get(id(model), document.root.get("version")))


def _has_frames(text: str) -> bool:
    return tuple(map(int, re.findall(r"\d+", text))) >= _NESTING


def _single_model(
    root: XmlElement, holder: XmlElement, model: XmlElement, versions: dict[int, str]
) -> XmlElement:
    """Return a file of one moving model, with its world and the world's static models."""
    file = XmlElement("sdf", {"version": versions.get(id(model), root.get("version"))})
    inner = file if holder is root else file.append(XmlElement("world", dict(holder.attributes)))
    for child in holder:
        if child is model or (child.tag != "world" and (child.tag != "model" or is_static(child))):
            inner.children.append(child)
    return file


def _lines(element: XmlElement) -> Iterator[str]:
    from xml.sax.saxutils import escape, quoteattr  # it loads urllib.request

    attributes = "".join(f" {key}={quoteattr(text)}" for key, text in element.attributes.items())
    start, end = f"<{element.tag}{attributes}>{escape(element.text.strip())}", f"</{element.tag}>"
    if not element.children:
        yield start + end  # some readers keep a line break in a name
        return
    yield start
    for child in element:
        yield from _lines(child)
    yield end


def _marks(element: XmlElement, above: tuple[str, int]) -> Iterator[tuple[str, int]]:
    """Yield the place of each element in document order; an added one is where its parent is."""
    file, line = element.place
    here = above if file is None or line is None else (str(file), line)
    yield here
    for child in element:
        yield from _marks(child, here)


def _include(holder: XmlElement, file: Path, versions: dict[int, str], depth: int) -> bool:
    """Replace the includes of a root, world or model by models; return whether there are some."""
    changed = False
    for nested in holder.findall("model"):
        changed |= _include(nested, file, versions, depth)
    for include in holder.findall("include"):
        path = _locate(file, include.findtext("uri").strip())
        try:
            document = None if path is None or depth > _DEPTH else Document(path)
        except LocationError:
            document = None
        top = None if document is None else document.root.find("model")
        if path is None or document is None or top is None:
            continue
        if holder.tag == "model" and version(document) < _NESTING:
            continue
        model = top.copy()
        _include(model, path, versions, depth + 1)
        _absolute(model, path)
        for tag in ("pose", "static"):
            for stated in include.findall(tag):
                model.children[:] = [one for one in model if one.tag != tag]
                model.append(stated.copy())
        for key, value in (
            ("name", include.findtext("name").strip()),
            ("placement_frame", include.findtext("placement_frame").strip()),
            (_MERGED, include.get("merge")),
        ):
            if value:
                model.set(key, value)
        holder.remove(include)
        holder.append(model)
        versions[id(model)] = document.root.get("version")
        changed = True
    return changed


_MERGED = "crosscheck-merged"
"""Attribute of a nested model whose content keeps its names."""


def _absolute(model: XmlElement, file: Path) -> None:
    for uri in (uri for mesh in model.iter("mesh") for uri in mesh.findall("uri")):
        path = _locate(file, uri.text.strip())
        uri.text = uri.text if path is None else str(path.resolve())


def _locate(file: Path, uri: str) -> Path | None:
    """Return the file of a model that a file includes, or None if it does not exist."""
    scheme, _, rest = uri.partition("://")
    folders: list[Path] = []
    if rest and scheme == "package":
        package, _, rest = rest.partition("/")
        folders += package_folders(package, file)
    elif rest and scheme in ("model", "file"):
        folders += (one for p in file.absolute().parents[:LEVELS] for one in (p, p / "models"))
        paths = (one for key in _PATHS for one in os.environ.get(key, "").split(os.pathsep))
        folders += map(Path, filter(None, paths))
    elif not rest:
        folders.append(file.parent)
    for folder in folders:
        path = folder / (rest or uri)
        if path.is_dir():
            config = path / "model.config"
            text = config.read_text(errors="replace") if config.is_file() else ""
            path /= ([*re.findall(r"<sdf[^>]*>\s*([^<\s]+)\s*<", text)] or ["model.sdf"])[-1]
        if path.is_file():
            return path
    return None


def _connect(world: XmlElement) -> bool:
    """Make one model of those that joints of the world connect; return whether there are some."""
    joints = world.findall("joint")
    ends = [joint.findtext(tag).strip() for joint in joints for tag in ("parent", "child")]
    names = {end.partition("::")[0] for end in ends} - {WORLD}
    models = [one for one in world.findall("model") if one.get("name") in names]
    if not joints or len(models) != len(names) or any(map(is_static, models)):
        return False
    whole = XmlElement("model", {"name": world.get("name") or "world"})
    for part in (*models, *joints):
        world.remove(part)
        whole.append(part)
    world.append(whole)
    return True


def _flatten(model: XmlElement) -> bool:
    """Move the content of nested models into their parent; return whether there are some."""
    changed = False
    for nested in model.findall("model"):
        if is_static(nested) or nested.get("placement_frame") or nested.find("include"):
            return changed
        _flatten(nested)
        _move(nested, model)
        changed = True
    if changed:
        _rename(model, lambda name: name.removesuffix(f"::{MODEL}").replace("::", "__"))
    return changed


def _split(holder: XmlElement, model: XmlElement, versions: dict[int, str]) -> list[XmlElement]:
    """Replace a model by one for each group of links that joints connect, and return these.

    The group of the world, or of the first link, keeps the model's name. Links of other groups
    become frames, since poses may refer to them.
    """
    group, text, firsts = _groups(model), versions[id(model)], dict[str, str]()
    for name in list(group)[1:]:
        firsts.setdefault(group[name], name)
    keys = sorted(firsts, key=lambda key: key != group[WORLD])
    parts = [model, *(model.copy() for _ in keys[1:])]
    for key, part in zip(keys, parts, strict=False):  # no key without a link
        if part is not model:
            part.set("name", f"{model.get('name')}.{firsts[key]}")
            versions[id(holder.append(part))] = text
        for other in [one for one in part if group.get(one.get("name"), key) != key]:
            if other.tag == "link" and _has_frames(text):
                other.tag, other.children = "frame", other.findall("pose")
            elif other.tag in ("link", "joint"):
                part.remove(other)
    return parts


def _groups(model: XmlElement) -> dict[str, str]:
    """Return the group of the world, of each link and of each joint, by names.

    All are one group if a joint names an unknown link, which the reader reports.
    """
    links, joints = ({one.get("name"): one for one in model.findall(tag)} for tag in NAMED[:2])
    frames = {one.get("name"): one.get("attached_to") for one in model.findall("frame")}

    def ends(joint: XmlElement) -> list[str]:
        names = [joint.findtext(tag).strip() for tag in ("parent", "child")]
        for _ in frames:
            names = [frames.get(name, name) for name in names]
        return names

    group = {name: name for name in (WORLD, *links)}
    for joint in joints.values():
        leaders = [joints.get(one.get("joint"), joint) for one in joint.findall("axis/mimic")]
        held = {end for one in (joint, *leaders) for end in ends(one)}
        if not group.keys() >= held:
            return dict.fromkeys((WORLD, *links, *joints), WORLD)
        merged = {group[end] for end in held}
        group = {name: min(merged) if one in merged else one for name, one in group.items()}
    return group | {name: group[ends(joint)[1]] for name, joint in joints.items()}


def _move(nested: XmlElement, model: XmlElement) -> None:
    """Move the links, joints and frames of a nested model, and add its own frame."""
    name, merged = nested.get("name"), nested.get(_MERGED).lower() in ("1", "true")
    prefix, frame = ("", f"_merged__{name}__model__") if merged else (f"{name}__", name)
    parts = [one for one in nested if one.tag in NAMED]
    links = [one.get("name") for one in parts if one.tag == "link"]
    canonical = nested.get("canonical_link") or (links[0] if links else "")
    _rename(nested, lambda inner: {MODEL: frame, WORLD: WORLD}.get(inner, prefix + inner))
    model.remove(nested)
    moved = model.append(XmlElement("frame", {"name": frame, "attached_to": prefix + canonical}))
    pose = nested.find("pose")
    stated = {} if pose is None else pose.attributes
    text = "0 0 0 0 0 0" if pose is None else pose.text
    moved.append(XmlElement("pose", {"relative_to": MODEL, **stated}, text=text))
    for part in parts:
        part.set("name", prefix + part.get("name"))
        if part.tag == "frame" and not part.get("attached_to"):
            part.set("attached_to", frame)
        placed = part.find("pose")
        if part.tag == "link" and placed is None:
            part.append(XmlElement("pose", {"relative_to": frame}, text="0 0 0 0 0 0"))
        elif part.tag == "link" and placed is not None and not placed.get("relative_to"):
            placed.set("relative_to", frame)
        model.append(part)


def _rename(model: XmlElement, new: Callable[[str], str]) -> None:
    """Rename what the links, joints and frames of a model refer to."""
    for part in [one for one in model if one.tag in NAMED]:
        for element in list(part.iter()):
            keys: Sequence[str] = ("joint",) if element.tag == "mimic" else _REFERENCES
            for key in keys:
                if element.get(key):
                    element.set(key, new(element.get(key)))
        for end in [*part.findall("parent"), *part.findall("child")]:
            end.text = new(end.text.strip())
