"""The robots of the gallery, each from a commit of a public repository."""

from __future__ import annotations

import re
import subprocess
import tomllib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

ROBOTS = Path(__file__).with_name("robots.toml")
"""The robots, with their repositories."""

SOURCE = "https://github.com/{owner}/{repository}"
"""Address of a repository."""


@dataclass(frozen=True, kw_only=True)
class RobotFile:
    """A file of a robot.

    Attributes:
        robot: title of the robot.
        kind: of robot, such as "arm".
        owner, repository: of the repository.
        commit: its hash.
        licence: SPDX identifier.
        path: of the file in the repository.
    """

    robot: str
    kind: str
    owner: str
    repository: str
    commit: str
    licence: str
    path: str

    @property
    def suffix(self) -> str:
        """Suffix of the file, without a dot."""
        return Path(self.path).suffix[1:]

    @property
    def slug(self) -> str:
        """Name of the robot and its format, for folders and addresses."""
        name = re.sub(r"\W+", "-", self.robot.lower()).strip("-")
        return f"{name}.{self.suffix}"

    @property
    def address(self) -> str:
        """Address of the file in the repository."""
        return f"{self.source(SOURCE)}/blob/{self.commit}/{self.path}"

    def source(self, pattern: str) -> str:
        """Return the address or path of its repository, by a pattern such as `SOURCE`."""
        return pattern.format(owner=self.owner, repository=self.repository)

    def fetched(self, clones: Path, pattern: str) -> Path:
        """Return the file's path, after a fetch of its folder at the commit.

        Raises:
            subprocess.CalledProcessError: if the commit can't be fetched.
            FileNotFoundError: if the checkout has no such file.
        """
        folder = clones / self.owner / self.repository
        if not folder.exists():
            _git(folder.parent, "init", "--quiet", folder.name)
            _git(folder, "remote", "add", "origin", self.source(pattern))
        if _git(folder, "cat-file", "-e", self.commit, check=False):
            _git(folder, "fetch", "--depth", "1", "--filter=blob:none", "origin", self.commit)
        place = Path(*Path(self.path).parts[:-1][:2])  # with meshes and included files
        _git(folder, "checkout", "--quiet", self.commit, "--", str(place), check=False)
        if not (folder / self.path).is_file():
            raise FileNotFoundError(f"{self.address}: the checkout has no such file")
        return folder / self.path


def _git(folder: Path, *arguments: str, check: bool = True) -> int:
    """Run git quietly, and return its exit code; with `check`, print the errors of a failure."""
    folder.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(["git", *arguments], cwd=folder, check=False, capture_output=True)
    if check and done.returncode:
        print(done.stderr.decode(errors="replace"), end="", flush=True)
        done.check_returncode()
    return done.returncode


def robot_files(names: Collection[str] = (), listing: Path = ROBOTS) -> Iterator[list[RobotFile]]:
    """Yield the files of each robot, or of those whose title contains a name.

    Raises:
        ValueError: for a repository without a commit, naming the robot.
    """
    table = tomllib.loads(listing.read_text("utf-8"))
    for robot, row in table["robots"].items():
        if names and not any(name.lower() in robot.lower() for name in names):
            continue
        files = []
        for file in row["files"]:
            owner, repository, path = file.split("/", 2)
            if (origin := table["repositories"].get(f"{owner}/{repository}")) is None:
                raise ValueError(f"{listing}: {robot}: {owner}/{repository} has no commit")
            place = {"owner": owner, "repository": repository, "path": path}
            files.append(RobotFile(robot=robot, kind=row["kind"], **place, **origin))
        yield files
