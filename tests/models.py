"""Model files that tests write, and the task that compares one with its own equations."""

from pathlib import Path

from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare_tree
from physics_crosscheck.harness.checks.task import ModelTask, model_task


def written(folder: Path, name: str, text: str, *replacements: tuple[str, str]) -> Path:
    """Write a text to a file, with some of it replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    (folder / name).write_text(text)
    return folder / name


def robot_task(
    folder: Path, name: str, text: str, engine: str = "mujoco", *, floating: bool = False
) -> ModelTask[PreparedTree]:
    """Write a robot file; return its task in an engine, with few states."""
    file = written(folder, name, text)
    return model_task(prepare_tree(file, floating=floating, states=8), engine)


def edited(path: Path, old: str, new: str) -> Path:
    """Replace a text that a file has."""
    return written(path.parent, path.name, path.read_text(), (old, new))
