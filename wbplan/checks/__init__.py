"""Every promise of a plan, recomputed from the joint trajectory alone.

Nothing here knows how a plan is made: the robot is rebuilt from the bundle's own URDF, its motion from
`q`, and the promises are those of the phases as written in plan.json. What planned is never what approves.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wbplan.bundle import Bundle
from wbplan.checks import balance, clearance, contacts, forces, joints, objects
from wbplan.checks.replay import Replay
from wbplan.checks.report import CheckReport, Row, Tolerances

__all__ = ["CheckReport", "Row", "check"]


def check(
    bundle: Bundle,
    *,
    slip: float = 1e-4,
    closure: float = 1e-4,
    rotation: float = 1e-3,
    ground: float = 1e-4,
    folders: Sequence[str | Path] = (),
) -> CheckReport:
    """Recompute every promise of a bundle at every sample.

    A sample on the edge of two phases keeps the promises of both.

    Args:
        bundle: what is to be checked.
        slip: how far a foot in contact may move [m].
        closure: how far a closed loop, or an object in its holder, may open [m].
        rotation: how far it may turn [rad].
        ground: how far contacts of one level may differ in height [m].
        folders: where the robot's meshes are looked for, if it has any.

    Returns:
        One row a promise with its worst value, when and where it fell; promises that no phase makes
        have no row.

    Raises:
        BundleError: the bundle is not what a bundle has to be (shapes, names, phases).
    """
    bounds = Tolerances(slip=slip, closure=closure, rotation=rotation, ground=ground)
    with np.errstate(all="ignore"):  # what overflows or has no value becomes a broken row
        bundle.validate(values=False)
        rows = joints.sampling_rows(bundle)
        if all(row.held for row in rows):  # else nothing more can be computed
            replay = Replay.of(bundle)
            for rules in (joints.rows, contacts.rows, balance.rows, forces.rows, objects.rows):
                rows.extend(rules(replay, bounds))
            rows.extend(clearance.rows(bundle, replay, tuple(Path(folder) for folder in folders)))
    return CheckReport(tuple(rows))
