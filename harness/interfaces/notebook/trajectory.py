"""A motion as named arrays with units: simulated, solved, or a difference."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.mechanism.numeric import Array
from .markup import Indices, block, curve, line, shown, table
from .optional import frame, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TIME = "t (s)"

TITLE = 95
"""Maximum characters per line of a plot's title."""

SAME = 1e-9
"""Relative tolerance of equal times: engines add up rounded steps."""

ROUNDING = 1e-12
"""Share of a column's largest value; a column with a smaller range is constant."""

FEWEST = 2
"""Minimum number of common times for a difference of two trajectories."""


class MotionError(ValueError):
    """A motion that is not available; the message gives the reason and the alternatives."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Quantities of a mechanism over time: coordinates, rates, outputs and energy.

    `trajectory["theta"]` is a column, (n,). `a - b` is the difference at the common times.

    Attributes:
        t: times, s, ascending, (n,).
        names: the k columns: coordinates, their rates `NAME_dot`, outputs and `energy`.
        units: unit of each column, such as "rad/s"; "1" without a unit.
        values: (n, k); not finite after a simulation diverged.
        uncertainty: error bound of each value, (n, k); None if unknown, as for a simulation.
        system: name of the mechanism.
        scenario: name or start values.
        origin: file, engine, integrator and step; or the method that solved the equations.
        step: time step of the engine, s; None for solved equations.
    """

    t: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    uncertainty: Array | None
    system: str
    scenario: str
    origin: str
    step: float | None

    def __post_init__(self) -> None:
        for array in (self.t, self.values, self.uncertainty):
            if array is not None:
                array.flags.writeable = False

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Arrays from another process are writable.
        self.__dict__.update(state)
        self.__post_init__()

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, name: str) -> Array:
        return self.values[:, self._index(name)]

    def uncertainty_of(self, name: str) -> Array:
        """Return the error bound of a column, (n,).

        Raises:
            KeyError: if the column is unknown; the message lists the columns.
            ValueError: if no bound is known.
        """
        place = self._index(name)
        if self.uncertainty is None:
            raise ValueError(
                f"no error bound is known of {self.origin}; compare it with solve(...)"
            )
        return self.uncertainty[:, place]

    def label(self, name: str) -> str:
        """Return a column's name with its unit, such as `theta (rad)`.

        Raises:
            KeyError: if the column is unknown; the message lists the columns.
        """
        unit = self.units[self._index(name)]
        return name if unit == "1" else f"{name} ({unit})"

    def minus(self, other: Trajectory) -> Trajectory:
        """Return the difference of two trajectories at their common times.

        The uncertainty is the sum of the known uncertainties.

        Raises:
            MotionError: if the columns differ, or there are too few common times.
        """
        self._check_alike(other)
        here, there = self._common(other)
        parts = [
            part[rows]
            for part, rows in ((self.uncertainty, here), (other.uncertainty, there))
            if part is not None
        ]
        return replace(
            self,
            t=self.t[here],
            values=self.values[here] - other.values[there],
            uncertainty=np.sum(parts, axis=0) if parts else None,
            origin=f"{self.origin} minus {other.origin}",
        )

    def __sub__(self, other: Trajectory) -> Trajectory:
        return self.minus(other) if isinstance(other, Trajectory) else NotImplemented

    def to_frame(self, library: str = "") -> Any:
        """Return a table with one row per time and one column per quantity, such as `theta (rad)`.

        With an uncertainty, each quantity has a column such as `theta uncertainty (rad)` too.

        Args:
            library: "pandas" or "polars"; empty: the first that is installed.

        Raises:
            ImportError: if none is installed; the message names what to install.
        """
        columns: dict[str, Array] = {TIME: self.t}
        columns |= {self.label(name): self[name] for name in self.names}
        if self.uncertainty is not None:
            for name in self.names:
                heading = self.label(name).replace(name, f"{name} uncertainty", 1)
                columns[heading] = self.uncertainty_of(name)
        return frame(columns, library)

    def plot(self, *names: str, ax: Axes | None = None) -> tuple[Axes, ...]:
        """Draw columns over time, with one panel per unit.

        Args:
            names: columns; none: all.
            ax: axes for all columns; None: a new figure.

        Returns:
            The axes, top to bottom.

        Raises:
            KeyError: if a column is unknown; the message lists the columns.
            ImportError: without matplotlib; the message names what to install.
        """
        wanted = names or self.names
        labels = {name: self.label(name) for name in wanted}
        if ax is not None:
            self._draw(ax, labels)
            ax.set_xlabel(TIME)
            return (ax,)
        units = dict.fromkeys(self.units[self._index(name)] for name in wanted)
        axes = new_axes(len(units), 1.7)
        for unit, panel in zip(units, axes, strict=True):
            unit_columns = [name for name in wanted if self.units[self._index(name)] == unit]
            self._draw(panel, {name: labels[name] for name in unit_columns})
        title = textwrap.fill(f"{self.system}, {self.scenario}: {self.origin}", TITLE)
        axes[0].set_title(title, fontsize="small")
        axes[-1].set_xlabel(TIME)
        return tuple(axes)

    def _draw(self, ax: Axes, labels: dict[str, str]) -> None:
        for name, label in labels.items():
            (drawn,) = ax.plot(self.t, self[name], label=label, linewidth=1.2)
            if self.uncertainty is not None:
                low, high = (self[name] + s * self.uncertainty_of(name) for s in (-1, 1))
                ax.fill_between(self.t, low, high, color=drawn.get_color(), alpha=0.25, linewidth=0)
        if len(labels) == 1:
            ax.set_ylabel(next(iter(labels.values())))
        else:
            ax.legend(loc="upper right", fontsize="small")
        ax.grid(alpha=0.3)

    def __repr__(self) -> str:
        what = ", ".join(map(self.label, self.names))
        return (
            f"<Trajectory of {self.system}, {self.scenario}: {counted(len(self), 'time')} to"
            f" {self.t[-1]:g} s of {what}; {self.origin}>"
        )

    def _repr_html_(self) -> str:
        has_bounds = self.uncertainty is not None
        heads = (
            ["", "first", "last", "smallest", "largest"] + ["known to"] * has_bounds + ["over time"]
        )
        rows = [self._row(name) for name in self.names]
        blown = np.flatnonzero(~np.isfinite(self.values).all(axis=1))
        remarks = [line(f"not finite from t = {self.t[blown[0]]:g} s on")] if len(blown) else []
        return block(
            line(f"{self.system}, {self.scenario}", strong=True),
            line(f"{self.origin}; {counted(len(self), 'time')} to {self.t[-1]:g} s", faint=True),
            *remarks,
            table(heads, rows),
        )

    def _row(self, name: str) -> list[str]:
        values = self[name]
        finite = values[np.isfinite(values)]
        extremes = (np.min(finite), np.max(finite)) if len(finite) else (np.nan, np.nan)
        sizes = (values[0], values[-1], *extremes)
        cells = [escape(self.label(name)), *(shown(float(x), "{:.6g}") for x in sizes)]
        if self.uncertainty is not None:
            cells.append(shown(float(np.max(self.uncertainty_of(name))), "{:.1e}"))
        # Hide rounding of a constant quantity, such as energy.
        noise = ROUNDING * float(np.max(np.abs(finite), initial=0.0))
        if self.uncertainty is not None:
            noise = max(noise, 2 * float(np.max(self.uncertainty_of(name))))
        return [*cells, curve(self.t, values, f"{name} over time", noise)]

    def _index(self, name: str) -> int:
        if name not in self.names:
            raise KeyError(f"there is no {name!r}; there are {', '.join(self.names)}")
        return self.names.index(name)

    def _check_alike(self, other: Trajectory) -> None:
        columns, others = (tuple(zip(x.names, x.units, strict=True)) for x in (self, other))
        if columns != others:
            here, there = (", ".join(map(x.label, x.names)) for x in (self, other))
            raise MotionError(
                f"these are not the same quantities: {here} of {self.system}, and {there} of"
                f" {other.system}"
            )

    def _common(self, other: Trajectory) -> tuple[Indices, Indices]:
        """Return the rows of the common times in both."""
        near = np.clip(np.searchsorted(other.t, self.t), 1, max(len(other.t) - 1, 1))
        before = np.maximum(near - 1, 0)
        near = np.minimum(near, len(other.t) - 1)
        closer = np.abs(other.t[before] - self.t) <= np.abs(other.t[near] - self.t)
        nearest = np.where(closer, before, near)
        here = np.flatnonzero(np.abs(other.t[nearest] - self.t) <= SAME * max(self.t[-1], 1e-300))
        if len(here) < FEWEST:
            raise MotionError(
                f"they share {counted(len(here), 'time')}; ask for the same ones, as in"
                " solve(system, scenario, times=simulated.t)"
            )
        return here, nearest[here]


def units_of_rates(units: Sequence[str]) -> list[str]:
    """Return the units of the rates of quantities."""
    return [f"{unit}/s" for unit in units]
