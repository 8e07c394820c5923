"""Changes of copied built-in folders: default engines only, and few and short motions."""

import re
from pathlib import Path

from physics_crosscheck.harness.engines.registry import engines


def keep_default_engines(folder: Path) -> None:
    """Remove engines of extras and their settings from the sidecars of a folder.

    Remove a model that has no other engines.
    """
    extras = "|".join(name for name, engine in engines().items() if engine.extra)
    for path in folder.glob("*.toml"):
        text = re.sub(rf', "({extras})"', "", path.read_text(encoding="utf-8"))
        if re.search(rf'^engines = \["({extras})"\]', text, flags=re.MULTILINE):
            path.unlink()
            path.with_suffix("").unlink()
            continue
        settings = rf"(?:^#[^\n]*\n)*^\[settings\.(?:{extras})\]\n(?:[^\n]+\n)*\n?"
        path.write_text(re.sub(settings, "", text, flags=re.MULTILINE), encoding="utf-8")


def shorten_scenarios(folder: Path, share: int = 4) -> None:
    """Divide the duration of each scenario of a folder by `share`.

    Every motion keeps some swings, and each input its first discontinuity.
    """
    path = folder / "system.py"
    text = path.read_text(encoding="utf-8")

    def shorter(match: re.Match[str]) -> str:
        return f"duration={float(match[1]) / share:g}"

    text, count = re.subn(r"\bduration=([\d.]+)", shorter, text)
    assert count, f"{path} states no duration"
    path.write_text(text, encoding="utf-8")


def without(folder: Path, *scenarios: str) -> None:
    """Remove scenarios from a folder."""
    path = folder / "system.py"
    text = path.read_text(encoding="utf-8")
    for name in scenarios:
        pattern = rf' *Scenario\("{name}".*?duration=[\d.]+\),\n'
        text, count = re.subn(pattern, "", text, flags=re.DOTALL)
        assert count == 1, f"{path} has no scenario {name}"
    path.write_text(text, encoding="utf-8")
