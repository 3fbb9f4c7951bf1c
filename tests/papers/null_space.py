"""HIphanT's own method: the velocity of body and arm by null-space projection, the legs after the body.

q' = J+ x' + (I - J+ J) phi, over three translations and three turns of the body along the world's axes and
the arm's six joints. phi is made of numerical changes of w, each with the rest moved so that the tip stays,
and of the CoM's distance from the middle of the feet.

Source: HIphanT, equations 29 and 34 to 49.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbplan as wb

#: The step Delta q of equation 41 [m, rad].
STEP = 1e-6


class NullSpace:
    def __init__(self, robot: wb.Robot, tip: str, arm: list[str], feet: list[str]) -> None:
        self.robot, self.model, self.data = robot, robot.model, robot.model.createData()
        self.tip, self.feet = robot.frame_id(tip), [robot.frame_id(f) for f in feet]
        self.arm = np.array([robot.joint_index(j)[1] for j in arm])
        self.legs = np.array([c for c in range(6, self.model.nv) if c not in self.arm])

    def frame_jacobian(self, q: np.ndarray, frame: int) -> np.ndarray:
        """(6, nv) with the body's velocity along the world's axes in the first six columns."""
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        found = np.array(pin.computeFrameJacobian(self.model, self.data, q, frame, axes))
        found[:, :6] = found[:, :6] @ np.kron(np.eye(2), pin.XYZQUATToSE3(q[:7]).rotation.T)
        return found

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Equation 34, (6, 12)."""
        whole = self.frame_jacobian(q, self.tip)
        return np.hstack([whole[:, :6], whole[:, self.arm]])

    def measure(self, q: np.ndarray) -> float:
        """Equation 38."""
        J = self.jacobian(q)
        return float(np.sqrt(np.linalg.det(J @ J.T)))

    def moved(self, q: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The configuration after a step (12,) of body and arm; the legs stay, w does not see them."""
        new = q.copy()
        rotation = pin.exp3(y[3:6]) @ pin.XYZQUATToSE3(q[:7]).rotation
        new[:7] = pin.SE3ToXYZQUAT(pin.SE3(rotation, q[:3] + y[:3]))
        new[self.arm + 1] += y[6:]
        return new

    def constrained_gradient(self, q: np.ndarray) -> np.ndarray:
        """Equations 41 to 44: (12,) changes of w, coordinate by coordinate, with the tip where it is."""
        J = self.jacobian(q)
        project = np.eye(12) - np.linalg.pinv(J) @ J
        here = self.measure(q)
        return np.array([(self.measure(self.moved(q, STEP * column)) - here) / STEP for column in project.T])

    def velocity(self, q: np.ndarray, twist: np.ndarray, phi: np.ndarray) -> np.ndarray:
        """Equation 36: (12,) of body and arm."""
        J = self.jacobian(q)
        inverse = np.linalg.pinv(J)
        return inverse @ twist + (np.eye(12) - inverse @ J) @ phi

    def com_term(self, q: np.ndarray, gain: float) -> np.ndarray:
        """Equation 48: the body's translation toward the middle of the feet, (12,)."""
        com = np.array(pin.centerOfMass(self.model, self.data, q))
        pin.framesForwardKinematics(self.model, self.data, q)
        middle = np.mean([self.data.oMf[f].translation for f in self.feet], axis=0)
        term = np.zeros(12)
        term[:2] = gain * (middle - com)[:2]
        return term

    def step(self, q: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Equation 49 and 29: (nv,) tangent step in the body's axes, for a step (12,) of body and arm."""
        whole = np.zeros(self.model.nv)
        whole[:6] = np.kron(np.eye(2), pin.XYZQUATToSE3(q[:7]).rotation.T) @ y[:6]
        whole[self.arm] = y[6:]
        A = np.vstack([self.frame_jacobian(q, f)[:3] for f in self.feet])
        whole[self.legs] = -np.linalg.solve(A[:, self.legs], A[:, :6] @ y[:6])
        return whole
