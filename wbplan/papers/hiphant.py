"""HIphanT: body pose from three feet, leg screws, and the arm's whole-body Jacobian."""

from __future__ import annotations

from functools import partial

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.mechanism import (
    Platform,
    body_acceleration,
    body_pose,
    chain_to,
    joint_rates,
    point_leg,
    positions,
    projected_twist,
    skew,
    swap,
    whole_body_jacobian,
)
from wbplan.papers import constraint
from wbplan.papers.rows import Row
from wbplan.robot import load_robot

Array = NDArray[np.float64]

row = partial(Row, "HIphanT")
#: Origin, x and y side of the foot plane: right rear, right front, left rear.
FEET = ("rr_foot", "rf_foot", "lr_foot")


def configuration(seed: int) -> Array:
    """The robot standing, its body moved and turned at random, joints changed at random."""
    robot = load_robot("hiphant")
    random = np.random.default_rng(seed)
    q = np.array(robot.state("stand").q)
    q[7:] += random.uniform(-0.2, 0.2, len(q) - 7)
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(pin.exp3(random.uniform(-0.3, 0.3, 3)), random.uniform(-0.5, 0.5, 3)))
    return q


def frames(count: int = 10) -> list[Row]:
    """Equations 1 to 7: the body's pose from joint angles and three foot points."""
    robot = load_robot("hiphant")
    worst = square = 0.0
    for seed in range(count):
        q = configuration(seed)
        state = robot.state(q)
        world = [state.pose(f).translation for f in FEET]
        chains = [chain_to(robot, f) for f in FEET]
        body = [c.pose(positions(robot, c.joints, q)).translation for c in chains]
        found = body_pose(world, body)
        worst = max(worst, float(np.abs(found.homogeneous - pin.XYZQUATToSE3(q[:7]).homogeneous).max()))
        square = max(square, float(np.abs(found.rotation @ found.rotation.T - np.eye(3)).max()))
    return [
        row("eqs 1-7", "pose of the body from three feet, error", 0.0, worst, 1e-12),
        row("eqs 1-4", "axes orthonormal, error", 0.0, square, 1e-12),
    ]


def screws(count: int = 5) -> list[Row]:
    """Equations 12 to 31: the projection A, joint rates from the body's and back, against Jacobians."""
    robot = load_robot("hiphant")
    parallel = classical = back = rates = acceleration = 0.0
    for seed in range(count):
        q = configuration(seed)
        random = np.random.default_rng(seed + 100)
        state, body = robot.state(q), pin.XYZQUATToSE3(q[:7])
        platform = Platform.of_robot(robot, state, ["rf", "lf", "rr", "lr"])
        legs, expected = [], []
        for name, chain in platform.chains.items():
            angles = positions(robot, chain.joints, q)
            leg = point_leg(chain, angles, body)
            legs.append(leg)
            parallel = max(parallel, float(np.abs(np.cross(leg.active[1, :3], leg.active[2, :3])).max()))
            foot = platform.feet[name]
            j = body.rotation @ chain.point_jacobian(angles)
            own = -np.linalg.solve(j, np.hstack([np.eye(3), -skew(foot)]))  # on (v_O; omega)
            expected.append(own)
            classical = max(
                classical, float(np.abs(swap(swap(leg.projection())) - own).max() / np.abs(own).max())
            )
        twist = random.uniform(-1, 1, 6)
        speed = joint_rates(legs, twist)
        rates = max(rates, float(np.abs(np.vstack(expected) @ swap(twist) - speed).max()))
        back = max(back, float(np.abs(projected_twist(legs, speed) - twist).max()))
        names = platform.joints
        right = constraint.solve(
            robot, q, [robot.feet[n] for n in platform.chains], dict(zip(names, speed, strict=True)), {}
        )
        rates = max(rates, float(np.abs(right.twist - twist).max()))
        # Joint accelerations that go with a chosen one of the body: q'' is the same map of A less L.
        chosen = random.uniform(-1, 1, 6)
        split = speed.reshape(-1, 3)
        rise = [
            leg.projection() @ swap(chosen - leg.lie_terms(leg.passive_rates(twist, s), s))
            for leg, s in zip(legs, split, strict=True)
        ]
        again = body_acceleration(legs, list(split), rise)
        right = constraint.solve(
            robot,
            q,
            [robot.feet[n] for n in platform.chains],
            dict(zip(names, speed, strict=True)),
            dict(zip(names, np.concatenate(rise), strict=True)),
        )
        acceleration = max(
            acceleration,
            float(np.abs(again - chosen).max()),
            float(np.abs(right.acceleration - chosen).max()),
        )
    return [
        row("eq 16", "second joint parallel to the third, error", 0.0, parallel, 1e-12),
        row("eqs 23-27", "A against -J^-1 [I, -[r]x]", 0.0, classical, 1e-9),
        row("eq 29", "joint rates against the constraint Jacobian", 0.0, rates, 1e-9),
        row("eqs 30, 31", "body's twist back from twelve joints", 0.0, back, 1e-9),
        row("eqs 12-31", "acceleration against the constraint Jacobian", None, acceleration),
    ]


def jacobian(count: int = 5) -> list[Row]:
    """Equations 32 to 34 and 38: the arm's tip over body and arm."""
    robot = load_robot("hiphant")
    worst = measure = 0.0
    shape = ""
    for seed in range(count):
        q = configuration(seed)
        chain = chain_to(robot, "arm_tip")
        angles = positions(robot, chain.joints, q)
        body = pin.XYZQUATToSE3(q[:7])
        arm = np.vstack([chain.point_jacobian(angles), chain.screws_at(angles)[:, :3].T])
        ours = whole_body_jacobian(body, chain.pose(angles).translation, arm)
        shape = "6 x 12" if ours.shape == (6, 12) else str(ours.shape)
        data = robot.model.createData()
        right = pin.computeFrameJacobian(
            robot.model, data, q, robot.frame_id("arm_tip"), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        columns = [robot.joint_index(j)[1] for j in chain.joints]
        base = right[:, :6] @ np.kron(
            np.eye(2), body.rotation.T
        )  # Pinocchio's base twist is in the body's axes
        worst = max(worst, float(np.abs(ours - np.hstack([base, right[:, columns]])).max()))
        root = float(np.sqrt(np.linalg.det(ours @ ours.T)))
        measure = max(measure, abs(root - float(np.prod(np.linalg.svd(ours, compute_uv=False)))))
    return [
        row("eq 34", "shape of the Jacobian", "6 x 12", shape, why="18 joints: the legs follow by eq 29"),
        row("eq 34", "against Pinocchio's, worst entry", 0.0, worst, 1e-12),
        row(
            "eq 38",
            "w less the product of singular values",
            0.0,
            measure,
            1e-9,
            why="not a mean of eigenvalues",
        ),
        row(
            "section 2",
            "stall torque behind the gear, 18 x 18.6",
            80.0,
            18.0 * 18.6,
            1.0,
            "N m",
            "80 / 18.6 = 4.3 N m",
            True,
        ),
    ]


TABLES = (frames, screws, jacobian)
