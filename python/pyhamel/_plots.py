"""Motions and families as lines of matplotlib.

Deliberately does not know: how anything is integrated or found.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ._errors import InputError
from ._packages import needed

if TYPE_CHECKING:
    from ._equilibria import Family
    from ._results import Motion


def of_motion(motion: Motion, names: Sequence[str], ax: Any) -> Any:
    """Columns over the time, with a line at each event."""
    columns = motion._columns()
    members = {group: [f"{group}.{name}" for name in motion.outputs.components(group)] for group in motion.outputs}
    chosen: list[str] = []
    for name in names or motion.model.state:
        if name not in columns and name not in members:
            raise InputError(f"the motion has no column `{name}`\n  columns: {', '.join([*columns, *members])}")
        chosen.extend(members[name] if name not in columns else [name])
    units = motion.model.units
    told = {name: units.get(name, "") for name in chosen}
    common = len(set(told.values())) == 1
    axes = _axes(ax)
    for name in chosen:
        axes.plot(motion.t, columns[name], label=name if common else _with_unit(name, told[name]))
    times: dict[str, list[float]] = {}
    for event in motion.events:
        times.setdefault(event.name, []).append(event.t)
    for k, (name, at) in enumerate(times.items()):
        axes.vlines(
            at, 0.0, 1.0, transform=axes.get_xaxis_transform(), label=name, colors=f"C{len(chosen) + k}",
            linestyles="dotted",
        )  # fmt: skip
    axes.set_xlabel(_with_unit("t", units["t"]))
    axes.set_ylabel(_with_unit(chosen[0] if len(chosen) == 1 else "", told[chosen[0]] if common else ""))
    if len(chosen) + len(times) > 1:
        axes.legend()
    return axes


def of_family(family: Family, names: Sequence[str], ax: Any) -> Any:
    """Components or the growth along the family, broken where it is unstable, with a mark at each change."""
    known: dict[str, Any] = {name: family.y[:, k] for k, name in enumerate(family.state)}
    known["growth"] = family.growth
    changed: dict[str, list[Any]] = {name: [change.at[name] for change in family.changes] for name in family.state}
    changed["growth"] = [max(change.at.eigenvalues.real, default=0.0) for change in family.changes]
    if len(family) and family[0].period is not None:
        known["period"] = np.array([orbit.period for orbit in family])
        changed["period"] = [change.at.period for change in family.changes]
    for name in names:
        if name not in known:
            raise InputError(f"the family has no column `{name}`\n  columns: {', '.join(known)}")
    chosen = names or ("growth",)
    unstable = np.array([one.verdict == "unstable" for one in family], dtype=bool)
    # Lines to a point that is unstable are broken as well.
    near = unstable.copy()
    near[1:] |= unstable[:-1]
    near[:-1] |= unstable[1:]
    axes = _axes(ax)
    for k, name in enumerate(chosen):
        for style, label, own, part in (("-", name, ~unstable, ~unstable), ("--", f"{name}, unstable", unstable, near)):
            if own.any():
                axes.plot(family.along, np.where(part, known[name], np.nan), style, color=f"C{k}", label=label)
    for kind, marker in zip(dict.fromkeys(change.kind for change in family.changes), "osD^"):
        marked = [k for k, change in enumerate(family.changes) if change.kind == kind]
        at = [(family.changes[k].at.along, changed[name][k]) for name in chosen for k in marked]
        axes.plot(*zip(*at), marker, color="black", label=kind)
    units = {"growth": "1/s", "period": "s", **(family[0].model.units if len(family) else {})}
    axes.set_xlabel(_with_unit(family.name, units.get(family.name, "")))
    axes.set_ylabel(_with_unit(chosen[0], units.get(chosen[0], "")) if len(chosen) == 1 else "")
    if axes.get_legend_handles_labels()[1]:
        axes.legend()
    return axes


def _axes(ax: Any) -> Any:
    return needed("matplotlib.pyplot", "matplotlib").subplots()[1] if ax is None else ax


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]".strip() if unit else name
