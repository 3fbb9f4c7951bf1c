"""The legged robot as a serial-parallel mechanism: limbs, the body on its legs, mobility and rates.

Screws are (direction, moment), angular part first, as in the papers (`wbplan.mechanism.screws`);
Jacobians have linear rows first, as Pinocchio's. Lengths are in metres, angles in radians.
"""

from wbplan.mechanism.actuation import ActuatedSet, actuated_sets
from wbplan.mechanism.forward import BodySolution, Follower, ForwardSolutions, forward
from wbplan.mechanism.leg import ThreeJointLeg
from wbplan.mechanism.limb5 import FiveJointLimb
from wbplan.mechanism.mobility import ClampLoop, Mobility, mobility, stance_mobility
from wbplan.mechanism.platform import Platform
from wbplan.mechanism.poe import Chain, chain_to, limb_chain, positions
from wbplan.mechanism.rates import (
    StanceLeg,
    body_acceleration,
    body_twist,
    cup_leg,
    joint_rates,
    origin_acceleration,
    point_leg,
    projected_twist,
    wrench_matrix,
)
from wbplan.mechanism.screws import adjoint, klein, lie, line, rank, reciprocal, skew, slide, swap
from wbplan.mechanism.solutions import LimbSolution, LimbSolutions
from wbplan.mechanism.stance import body_pose, foot_plane, whole_body_jacobian

__all__ = [
    "ActuatedSet",
    "BodySolution",
    "Chain",
    "ClampLoop",
    "FiveJointLimb",
    "Follower",
    "ForwardSolutions",
    "LimbSolution",
    "LimbSolutions",
    "Mobility",
    "Platform",
    "StanceLeg",
    "ThreeJointLeg",
    "actuated_sets",
    "adjoint",
    "body_acceleration",
    "body_pose",
    "body_twist",
    "chain_to",
    "cup_leg",
    "foot_plane",
    "forward",
    "joint_rates",
    "klein",
    "lie",
    "limb_chain",
    "line",
    "mobility",
    "origin_acceleration",
    "point_leg",
    "positions",
    "projected_twist",
    "rank",
    "reciprocal",
    "skew",
    "slide",
    "stance_mobility",
    "swap",
    "whole_body_jacobian",
    "wrench_matrix",
]
