"""A plan and its trajectory as data, written to and read from a folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbplan.bundle import files, rules
from wbplan.errors import BundleError
from wbplan.obstacles import Obstacle

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """The planned motion, sampled; SI units, N samples.

    Attributes:
        time: (N,) [s].
        q: (N, nq), base x y z [m] and quaternion qx qy qz qw in the world, then joints [rad, m].
        v: (N, nv), the constant tangent velocity from each sample to the next; the last row is 0.
        phase: (N,) index of the phase whose promises `com` and `margin` were computed for.
        com: (N, 3) [m], world: centre of mass of the robot and the objects that it carries.
        margin: (N,) [m] of the CoM in the support polygon, inside > 0; nan where there is no polygon.
        joint_names: the joints after the free flyer, in Pinocchio's order.
        bodies: object name -> (N, 7) its pose in the world, x y z [m] qx qy qz qw;
            nan while it has none.
        targets: task name -> (N, 7) the pose that it was asked for, world; nan where it was not.
        errors: "<task>.position" [m], "<task>.orientation" [rad] ... -> (N,); nan where absent.
        forces: frame -> (N, 3) [N], world, on the robot, of every contact, push and second finger of a clamp;
            zero where it does not touch.
        moments: frame of a second finger -> (N, 3) [N m], likewise.
        torque: (N, nv-6) [N m, N] of the joints, with these forces and the motion's accelerations.
        push: (N,) [N], the largest force on the CoM in the worst horizontal direction that the contacts bear;
            nan where there are too few.
        measures: "<task>.manipulability" [-] -> (N,); nan where absent.
    """

    time: Array
    q: Array
    v: Array
    phase: NDArray[np.int64]
    com: Array
    margin: Array
    joint_names: tuple[str, ...]
    bodies: Mapping[str, Array] = field(default_factory=dict)
    targets: Mapping[str, Array] = field(default_factory=dict)
    errors: Mapping[str, Array] = field(default_factory=dict)
    forces: Mapping[str, Array] = field(default_factory=dict)
    moments: Mapping[str, Array] = field(default_factory=dict)
    torque: Array | None = None
    push: Array | None = None
    measures: Mapping[str, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        return f"Trajectory({len(self)} samples, {len(self.joint_names)} joints, {self.time[-1]:g} s)"


@dataclass(frozen=True, eq=False, repr=False)
class Bundle:
    """A plan: what was promised, the robot it was planned with, and the motion.

    Attributes:
        plan: the content of plan.json.
        trajectory: the content of trajectory.npz.
        urdf: the text of robot.urdf.
    """

    plan: Mapping[str, Any]
    trajectory: Trajectory
    urdf: str

    def __repr__(self) -> str:
        return f"Bundle({self.plan.get('task')!r} on {self.plan.get('robot')!r}, {self.trajectory!r})"

    @property
    def phases(self) -> list[dict[str, Any]]:
        """The phases' promises, in the order of time."""
        return list(self.plan["phases"])

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """What stands in the world in any phase; a phase's `obstacles` names those that stand in it.

        Raises:
            BundleError: an entry is no obstacle.
        """
        return rules.obstacles_of(self.plan, files.PLAN)

    @cached_property
    def model(self) -> Any:
        """The `pinocchio.Model` of the bundle's own URDF, with a free-flyer root.

        Raises:
            BundleError: the text is no URDF.
        """
        return rules.model_of(self.urdf, files.URDF)

    def validate(self, *, values: bool = True, where: str = "") -> None:
        """Refuse a bundle whose fields are missing, misshapen or contradict each other.

        Args:
            values: also refuse values that are not finite.
            where: put before the file names in messages.

        Raises:
            BundleError: naming the file and the field, what was found and what was expected.
        """
        with np.errstate(all="ignore"):  # absurd numbers overflow, and are then refused
            rules.check_urdf(self.model, where + files.URDF)
            rules.check_arrays(self.trajectory, self.model, where + files.ARRAYS, values=values)
            rules.check_plan(self.plan, self.model, where + files.PLAN)
            rules.check_cover(self.plan, self.trajectory, where)

    def write(
        self,
        folder: str | Path,
        *,
        overwrite: bool = True,
        extras: Mapping[str, Callable[[Path], object]] | None = None,
    ) -> Path:
        """Write the bundle's files into a temporary folder, then move it into place whole.

        Whatever stops it, the target is left as it was and no temporary folder stays. Files that are
        not the bundle's own are taken over from a bundle that is replaced.

        Args:
            folder: target; absent, empty, or a bundle.
            overwrite: whether a bundle that is there may be replaced.
            extras: file name -> function that writes it, given its path (scene.html, plots.png).

        Returns:
            The folder.

        Raises:
            BundleError: the target cannot be written or is something else than a bundle, or this
                bundle is not valid.
        """
        self.validate()
        writers: dict[str, Callable[[Path], object]] = {
            files.PLAN: lambda path: files.write_plan(path, self.plan),
            files.URDF: lambda path: files.write_text(path, self.urdf),
            files.ARRAYS: lambda path: files.write_arrays(path, self._arrays()),
            files.TABLE: lambda path: files.write_table(path, *self._table()),
        }
        return files.write_folder(Path(folder), {**writers, **(extras or {})}, overwrite=overwrite)

    @classmethod
    def read(cls, folder: str | Path) -> Bundle:
        """Read a bundle and validate all of it.

        Raises:
            BundleError: naming the file and the field at fault.
        """
        folder = Path(folder)
        try:
            is_folder = folder.is_dir()
        except OSError as error:
            raise BundleError(f"{folder}: cannot be read: {error.strerror or error}") from error
        if not is_folder:
            found = "a file" if folder.is_file() else "nothing"
            raise BundleError(f"{folder}: expected a folder with a plan bundle, found {found}")
        plan = files.read_plan(folder / files.PLAN)
        urdf = files.read_text(folder / files.URDF)
        arrays = files.read_arrays(folder / files.ARRAYS)
        trajectory = _trajectory(arrays, str(folder / files.ARRAYS))
        bundle = cls(plan, trajectory, urdf)
        bundle.__dict__["model"] = rules.model_of(urdf, str(folder / files.URDF))
        bundle.validate(where=f"{folder}/")
        return bundle

    def _arrays(self) -> dict[str, NDArray[Any]]:
        motion = self.trajectory
        arrays: dict[str, NDArray[Any]] = {
            key: np.asarray(getattr(motion, key), dtype=np.float64) for key in rules.NUMBERS
        }
        arrays["phase"] = np.asarray(motion.phase, dtype=np.int64)
        arrays["joint_names"] = np.array(motion.joint_names, dtype=np.str_)
        for key in rules.OPTIONAL:
            if getattr(motion, key) is not None:
                arrays[key] = np.asarray(getattr(motion, key), dtype=np.float64)
        for key, group in rules.GROUPS.items():
            for name, values in getattr(motion, group).items():
                arrays[f"{key}_{name}"] = np.asarray(values, dtype=np.float64)
        return arrays

    def _table(self) -> tuple[list[str], Array]:
        """Column names and rows: time, base pose, one value a joint."""
        motion, model = self.trajectory, self.model
        joints = [rules.joint_values(model, name, motion.q) for name in motion.joint_names]
        return ["time", *rules.BASE, *motion.joint_names], np.column_stack(
            [motion.time, motion.q[:, :7], *joints]
        )


def _trajectory(arrays: Mapping[str, NDArray[Any]], where: str) -> Trajectory:
    """Sort the arrays of a file into a trajectory; their content is validated afterwards."""
    missing = [key for key in (*rules.NUMBERS, "phase", "joint_names") if key not in arrays]
    if missing:
        raise BundleError(
            f"{where}: missing {', '.join(missing)}; found {', '.join(sorted(arrays)) or 'no arrays'}"
        )
    names = arrays["joint_names"]
    if names.ndim != 1 or names.dtype.kind != "U":
        raise BundleError(f"{where}: joint_names: expected (nv-6,) text, found {names.shape} {names.dtype}")
    if arrays["phase"].dtype.kind not in "iu":
        raise BundleError(f"{where}: phase: expected whole numbers, found {arrays['phase'].dtype}")
    groups: dict[str, dict[str, Array]] = {group: {} for group in rules.GROUPS.values()}
    for key, values in arrays.items():
        kind, _, name = key.partition("_")
        if kind in rules.GROUPS and name:
            groups[rules.GROUPS[kind]][name] = rules.as_numbers(values, f"{where}: {key}")
    numbers = {key: rules.as_numbers(arrays[key], f"{where}: {key}") for key in rules.NUMBERS}
    return Trajectory(
        time=numbers["time"],
        q=numbers["q"],
        v=numbers["v"],
        phase=arrays["phase"].astype(np.int64),
        com=numbers["com"],
        margin=numbers["margin"],
        joint_names=tuple(str(name) for name in names),
        bodies=groups["bodies"],
        targets=groups["targets"],
        errors=groups["errors"],
        forces=groups["forces"],
        moments=groups["moments"],
        **{k: rules.as_numbers(arrays[k], f"{where}: {k}") for k in rules.OPTIONAL if k in arrays},
        measures=groups["measures"],
    )
