"""One replay: the servos follow the plan, and everything that touches is measured at every step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from wbplan.physics.disturbance import Disturbance
from wbplan.physics.engine import mujoco
from wbplan.physics.motion import Motion, Span
from wbplan.physics.options import Options
from wbplan.physics.scene import Scene
from wbplan.physics.spec import FLOOR, OBJECT, ROBOT, STAND

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

GROUNDED = FLOOR | ROBOT
LOADED = 0.5  #: a foot with at least this normal force [N] touches
OVER = 1.2  #: a base tilted this much [rad] ends the replay: nothing is learnt from the rest


@final
@dataclass(frozen=True, eq=False)
class Record:
    """What happened, one row a simulator step; C feet, J joints in Pinocchio's order.

    Attributes:
        time: (K,) [s] of the plan; below 0 while the robot settles.
        base: (K, 7) x y z qw qx qy qz.
        joints: (K, J).
        torque: (K, J) [N m, N] of the servos.
        normal: (K, C) [N] on each foot.
        tangent: (K, C) [N].
        force: (K, C, 3) [N], world, on each foot.
        slide: (K, C, 3) [m/s] of the foot's contact point over the ground, 0 in the air.
        feet: (K, C, 3) [m], the feet's frames.
        objects: name -> (K, 7) x y z qw qx qy qz.
        pads: frame -> (K,) [N], normal force on objects.
        pushed: frame that pushes on what is around -> (K,) [N], normal force there.
        grounded: name -> (K,), the object touches ground or stand.
        collision: (K,) [N], the largest force between two links.
        stray: (K,), something of the robot that is no foot touches the ground.
        links: the two links of the hardest self-collision, and the link that strayed first.
        finished: whether the plan was replayed to its end.
    """

    time: Array
    base: Array
    joints: Array
    torque: Array
    normal: Array
    tangent: Array
    force: Array
    slide: Array
    feet: Array
    objects: dict[str, Array]
    pads: dict[str, Array]
    pushed: dict[str, Array]
    grounded: dict[str, Bools]
    collision: Array
    stray: Bools
    links: tuple[str, str]
    finished: bool


def run(scene: Scene, motion: Motion, options: Options, disturbance: Disturbance | None = None) -> Record:
    """Replays a plan once.

    Args:
        scene: the world; it is changed for the time of the replay and put back.
        motion: the plan.
        options: what is assumed.
        disturbance: what is other than planned.
    """
    return _Run(scene, motion, options, disturbance or Disturbance()).go()


class _Run:
    def __init__(self, scene: Scene, motion: Motion, options: Options, disturbance: Disturbance) -> None:
        self.scene, self.motion, self.options, self.off = scene, motion, options, disturbance
        mj = mujoco()
        self.mj = mj
        self.model = disturbed(scene, disturbance)
        self.data = _copy_start(scene, self.model, motion)
        self.steps = round((options.settle + motion.duration + options.rest) / options.dt)
        K, C, J = self.steps, len(motion.feet), len(motion.names)
        self.base, self.joints, self.torque = np.zeros((K, 7)), np.zeros((K, J)), np.zeros((K, J))
        self.normal, self.tangent = np.zeros((K, C)), np.zeros((K, C))
        self.force = np.zeros((K, C, 3))
        self.slide, self.feet = np.zeros((K, C, 3)), np.zeros((K, C, 3))
        self.objects = {name: np.zeros((K, 7)) for name in scene.objects}
        self.pads = {pad: np.zeros(K) for pad in scene.pad_geoms}
        self.pushed = {frame: np.zeros(K) for frame in scene.push_geoms}
        self.grounded = {name: np.zeros(K, dtype=bool) for name in scene.objects}
        self.collision, self.stray = np.zeros(K), np.zeros(K, dtype=bool)
        self.clash, self.strayed, self.hardest = "", "", 0.0
        self.time: Array = np.arange(K, dtype=np.float64) * options.dt - options.settle
        self.targets = motion.joints + motion.offsets
        self.foot_of = np.full(self.model.ngeom, -1)
        for i, geoms in enumerate(scene.foot_geoms):
            self.foot_of[geoms] = i
        self.pad_of = {int(g): pad for pad, geoms in scene.pad_geoms.items() for g in geoms}
        self.pusher_of = {int(g): frame for frame, geoms in scene.push_geoms.items() for g in geoms}
        self.object_of = {
            int(g): name
            for name, (body, _) in scene.objects.items()
            for g in range(self.model.ngeom)
            if self.model.geom_bodyid[g] == body
        }
        self.sample = -1

    def go(self) -> Record:
        last = self.steps
        with np.errstate(all="ignore"):
            for k in range(self.steps):
                self._drive(float(self.time[k]))
                self.mj.mj_step(self.model, self.data)
                self._log(k)
                if self._over(k):
                    last = k + 1
                    break
        return self._record(last)

    # What the world is told.

    def _drive(self, t: float) -> None:
        motion = self.motion
        sample = motion.sample(max(t, 0.0))
        if self.sample < 0 or motion.phase[sample] != motion.phase[self.sample]:
            self._new_contacts(sample)
        self.sample = sample
        self._new_welds(t)
        self.data.ctrl[self.scene.act] = self._target(t - self.off.latency)
        self.data.xfrc_applied[self.scene.root, :3] = 0.0
        for push in self.off.pushes:
            if push.time <= t < push.time + push.seconds:
                self.data.xfrc_applied[self.scene.root, :3] += push.force

    def _target(self, t: float) -> Array:
        """The plan's joints at a time, on the straight line between its samples."""
        time = self.motion.time
        k = max(0, min(self.motion.sample(t), len(time) - 2))
        share = max(0.0, min((t - time[k]) / (time[k + 1] - time[k]), 1.0))
        target: Array = (1.0 - share) * self.targets[k] + share * self.targets[k + 1]
        return target

    def _new_contacts(self, sample: int) -> None:
        """Friction as the phase has it; feet as ball joints are fixed where they are planned to stand."""
        motion = self.motion
        for i, geoms in enumerate(self.scene.foot_geoms):
            on = bool(motion.touching[sample, i])
            if on:
                self.model.geom_friction[geoms, 0] = motion.friction[sample, i] * self.off.friction
            if len(self.scene.pins):
                pin = self.scene.pins[i]
                if on and not self.data.eq_active[pin]:
                    self.model.eq_data[pin, :3] = 0.0
                    self.model.eq_data[pin, 3:6] = motion.places[sample, i]
                self.data.eq_active[pin] = on

    def _new_welds(self, t: float) -> None:
        for name, weld in self.scene.welds.items():
            span = next((s for s in self.motion.spans if s.name == name and s.start <= t < s.end), None)
            if span is not None and not self.data.eq_active[weld]:
                self._weld(weld, span)
            self.data.eq_active[weld] = span is not None

    def _weld(self, weld: int, span: Span) -> None:
        """Fastens an object as it is now in its holder."""
        holder = self.model.body(span.holder).id
        body = self.scene.objects[span.name][0]
        place, turn, back = np.zeros(3), np.zeros(4), np.zeros(4)
        self.mj.mju_negQuat(back, self.data.xquat[holder])
        self.mj.mju_rotVecQuat(place, self.data.xpos[body] - self.data.xpos[holder], back)
        self.mj.mju_mulQuat(turn, back, self.data.xquat[body])
        self.model.eq_data[weld, :3] = 0.0
        self.model.eq_data[weld, 3:6], self.model.eq_data[weld, 6:10] = place, turn

    # What is measured.

    def _log(self, k: int) -> None:
        data, scene = self.data, self.scene
        self.base[k] = data.qpos[:7]
        self.joints[k] = data.qpos[scene.qpos]
        self.torque[k] = data.actuator_force[scene.act]
        self.feet[k] = data.xpos[scene.foot_bodies]
        for name, (_, at) in scene.objects.items():
            self.objects[name][k] = data.qpos[at : at + 7]
        if data.ncon:
            self._log_contacts(k)
        if len(scene.pins):
            self._log_pins(k)

    def _log_contacts(self, k: int) -> None:
        data, contacts = self.data, self.data.contact
        first = contacts.efc_address
        felt = np.flatnonzero(first >= 0)
        if not len(felt):
            return
        geoms, rows = contacts.geom[felt], first[felt]
        force = data.efc_force
        normal = force[rows]
        kinds = self.scene.kind[geoms]
        both = kinds[:, 0] | kinds[:, 1]
        ground = np.flatnonzero(both == GROUNDED)
        if len(ground):
            own = np.where(kinds[ground, 0] == ROBOT, geoms[ground, 0], geoms[ground, 1])
            feet, loads, at = self.foot_of[own], normal[ground], rows[ground]
            axes = contacts.frame[felt[ground]]
            sliding = self._sliding(own, contacts.pos[felt[ground]], axes[:, :3])
            upward = np.where(
                kinds[ground, 1] == ROBOT, 1.0, -1.0
            )  # on the second shape, along the first axis
            for c, foot in enumerate(feet):
                if foot >= 0:
                    self.normal[k, foot] += loads[c]
                    felt_force = force[at[c] : at[c] + 3]
                    self.tangent[k, foot] += np.hypot(felt_force[1], felt_force[2])
                    self.force[k, foot] += upward[c] * (felt_force @ axes[c].reshape(3, 3))
                    if loads[c] > LOADED:
                        self.slide[k, foot] = sliding[c]
                elif int(own[c]) in self.pusher_of:
                    self.pushed[self.pusher_of[int(own[c])]][k] += loads[c]
                elif loads[c] > LOADED:
                    self.stray[k] = True
                    self.strayed = self.strayed or self._link(own[c])
        if len(ground) < len(felt):
            self._log_touches(k, geoms, kinds, both, normal)

    def _log_touches(self, k: int, geoms: Any, kinds: Any, both: Any, normal: Array) -> None:
        """Contacts of links with each other, and of objects with anything."""
        for c in np.flatnonzero(both == ROBOT):
            if normal[c] > self.hardest:
                self.hardest = float(normal[c])
                self.clash = f"{self._link(geoms[c, 0])} - {self._link(geoms[c, 1])}"
            self.collision[k] = max(self.collision[k], normal[c])
        for c in np.flatnonzero(both & OBJECT):
            one, other = int(geoms[c, 0]), int(geoms[c, 1])
            if one not in self.object_of:
                one, other = other, one
            if self.scene.kind[other] in (FLOOR, STAND):
                self.grounded[self.object_of[one]][k] |= bool(normal[c] > 0.0)
            elif other in self.pad_of:
                self.pads[self.pad_of[other]][k] += normal[c]

    def _log_pins(self, k: int) -> None:
        data = self.data
        equality = data.efc_type[: data.nefc] == self.mj.mjtConstraint.mjCNSTR_EQUALITY
        for i, pin in enumerate(self.scene.pins):
            rows = np.flatnonzero(equality & (data.efc_id[: data.nefc] == pin))
            if len(rows) == 3:
                force = data.efc_force[rows]
                self.normal[k, i], self.tangent[k, i] = force[2], np.hypot(force[0], force[1])
                self.force[k, i] = force

    def _sliding(self, geoms: Any, places: Array, axes: Array) -> Array:
        """(n, 3) velocity of shapes' material points at their contacts, along the ground."""
        bodies = self.model.geom_bodyid[geoms]
        twist = self.data.cvel[bodies]
        x, y, z = (places - self.data.subtree_com[self.model.body_rootid[bodies]]).T
        a, b, c = twist[:, :3].T
        v = twist[:, 3:] + np.array([b * z - c * y, c * x - a * z, a * y - b * x]).T
        along: Array = v - axes * (axes * v).sum(axis=1)[:, None]
        return along

    def _link(self, geom: Any) -> str:
        return str(self.model.body(self.model.geom_bodyid[int(geom)]).name)

    def _over(self, k: int) -> bool:
        """Whether the robot lies on its side, or the simulation has gone wrong."""
        x, y = self.base[k, 4:6]
        upright = 1.0 - 2.0 * (x * x + y * y)
        return not np.isfinite(self.base[k]).all() or bool(upright < np.cos(OVER))

    def _record(self, last: int) -> Record:
        return Record(
            time=self.time[:last], base=self.base[:last], joints=self.joints[:last],
            torque=self.torque[:last], normal=self.normal[:last], tangent=self.tangent[:last],
            force=self.force[:last], slide=self.slide[:last], feet=self.feet[:last],
            objects={name: poses[:last] for name, poses in self.objects.items()},
            pads={name: force[:last] for name, force in self.pads.items()},
            pushed={name: force[:last] for name, force in self.pushed.items()},
            grounded={name: on[:last] for name, on in self.grounded.items()},
            collision=self.collision[:last], stray=self.stray[:last], links=(self.clash, self.strayed),
            finished=last == self.steps,
        )  # fmt: skip


def disturbed(scene: Scene, off: Disturbance) -> Any:
    """A copy of the scene's model with the disturbance in it."""
    import copy

    mj = mujoco()
    model = copy.copy(scene.model)
    carried = [body for body, _ in scene.objects.values()]
    links = np.setdiff1d(np.arange(1, model.nbody), carried)
    model.body_mass[links] *= off.mass
    model.body_inertia[links] *= off.mass
    model.body_ipos[scene.root] += off.com
    for body in carried:
        model.body_mass[body] *= off.object_mass
        model.body_inertia[body] *= off.object_mass
        model.body_ipos[body] += off.object_com
    model.geom_friction[:, 0] *= off.friction
    model.actuator_gainprm[scene.act, 0] *= off.gain
    model.actuator_biasprm[scene.act, 1] *= off.gain
    g = float(np.linalg.norm(model.opt.gravity))
    # A ground that slopes is a gravity that leans the other way.
    lean = np.array([np.sin(off.tilt[1]), -np.sin(off.tilt[0])])
    model.opt.gravity[:] = [g * lean[0], g * lean[1], -g * np.sqrt(max(1.0 - lean @ lean, 0.0))]
    mj.mj_setConst(model, mj.MjData(model))
    return model


def _copy_start(scene: Scene, model: Any, motion: Motion) -> Any:
    from dataclasses import replace

    return replace(scene, model=model).start(motion)
