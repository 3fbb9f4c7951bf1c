"""The leg-arm hexapod against the paper's tables: lengths, masses, ranges, forward kinematics."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pinocchio as pin
import pytest

from .conftest import Machine

ARMS, LEGS = ("limb1", "limb2"), ("leg3", "leg4", "leg5", "leg6")
LIMBS = (*ARMS, *LEGS)
