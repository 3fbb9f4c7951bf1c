from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from wbplan.bundle import Bundle, Trajectory
from wbplan.geometry import support_polygon

FEET = ("foot_a", "foot_b", "foot_c", "foot_d")
FOUR, THREE = FEET, FEET[1:]
BOX = (0.10, 0.20, 0.08)


def _leg(name: str, x: float, y: float) -> str:
    return f"""
  <link name="leg_{name}">
    <inertial><origin xyz="0 0 -0.1"/><mass value="0.3"/>
      <inertia ixx="1e-3" iyy="1e-3" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><origin xyz="0 0 -0.1"/><geometry><cylinder radius="0.02" length="0.2"/></geometry>
      <material name="steel"/></visual>
  </link>
  <joint name="hip_{name}" type="revolute"><parent link="base"/><child link="leg_{name}"/>
    <origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="9" velocity="5"/></joint>
  <link name="foot_{name}"/>
  <joint name="foot_{name}_fixed" type="fixed"><parent link="leg_{name}"/><child link="foot_{name}"/>
    <origin xyz="0 0 -0.2"/></joint>"""


STOOL = f"""<robot name="stool">
  <material name="steel"><color rgba="0.2 0.4 0.8 1"/></material>
  <link name="base">
    <inertial><mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><box size="0.4 0.3 0.06"/></geometry>
      <material name="paint"><color rgba="0.9 0.3 0.1 1"/></material></visual>
    <visual><origin xyz="0.1 0 0.05"/><geometry><sphere radius="0.03"/></geometry></visual>
  </link>{_leg("a", 0.15, 0.1)}{_leg("b", 0.15, -0.1)}{_leg("c", -0.15, 0.1)}{_leg("d", -0.15, -0.1)}
</robot>"""


@pytest.fixture(scope="session")
def stool() -> str:
    """A URDF: a plate on four legs, each with a hip; 5 links that are drawn, 4 feet that are not."""
    return STOOL


@pytest.fixture(scope="session")
def stool_model():
    return pin.buildModelFromXML(STOOL, pin.JointModelFreeFlyer())


def standing(model) -> np.ndarray:
    q = pin.neutral(model)
    q[2] = 0.2
    return q


@pytest.fixture
def q_stand(stool_model) -> np.ndarray:
    return standing(stool_model)


def _phase(name: str, start: float, end: float, feet: tuple[str, ...], **more) -> dict:
    contacts = [{"frame": foot, "friction": 0.7, "normal": [0.0, 0.0, 1.0]} for foot in feet]
    phase = {"name": name, "start": start, "end": end, "contacts": contacts, "margin": 0.02}
    return {**phase, "closures": [], "carried": [], "tasks": [], **more}


def planned(model, urdf: str, seconds: float = 2.0, dt: float = 0.01) -> Bundle:
    """Two phases: it waits on four feet; then, on three, one leg swings and a box rises."""
    n = round(seconds / dt) + 1
    time = np.arange(n) * dt
    half = seconds / 2.0
    swing = np.clip((time - half) / half, 0.0, 1.0)
    q = np.tile(standing(model), (n, 1))
    q[:, model.joints[model.getJointId("hip_a")].idx_q] = -0.8 * swing
    phase = (time >= half - 1e-9).astype(np.int64)
    com = np.column_stack([0.03 * np.sin(time), np.full(n, -0.04), np.full(n, 0.19)])
    boxes = np.tile([0.45, 0.0, 0.04, 0.0, 0.0, 0.0, 1.0], (n, 1))
    boxes[:, 2] += 0.1 * swing
    targets = np.where(phase[:, None] == 1, boxes, np.nan)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q[0])
    places = {foot: data.oMf[model.getFrameId(foot)].translation[:2].copy() for foot in FEET}
    regions = [support_polygon([places[foot] for foot in feet]) for feet in (FOUR, THREE)]
    margin = np.array([regions[p].margin(c[:2]) for p, c in zip(phase, com, strict=True)])
    held = [{"name": "box", "frame": "foot_a", "pose": [0, 0, 0, 0, 0, 0, 1], "mass": 0.5, "com": [0, 0, 0]}]
    plan = {
        "schema": 1,
        "wbplan": "0",
        "task": "swing <a leg>",
        "robot": "stool",
        "backend": "proxqp",
        "dt": dt,
        "bodies": [{"name": "box", "size": list(BOX), "mass": 0.5}],
        "phases": [
            _phase("stand on four", 0.0, half, FOUR),
            _phase("swing", half, seconds, THREE, carried=held),
        ],
        "report": {},
    }
    motion = Trajectory(
        time=time,
        q=q,
        v=np.zeros((n, model.nv)),
        phase=phase,
        com=com,
        margin=margin,
        joint_names=tuple(model.names[2:]),
        bodies={"box": boxes},
        targets={"box": targets},
    )
    return Bundle(plan, motion, urdf)


@pytest.fixture(scope="session")
def bundle(stool_model) -> Bundle:
    return planned(stool_model, STOOL)


def load_browser():
    """The helper beside this file; tests are no package, so it is not importable by name."""
    path = Path(__file__).with_name("browser.py")
    if "view_browser" not in sys.modules:
        spec = importlib.util.spec_from_file_location("view_browser", path)
        module = importlib.util.module_from_spec(spec)
        sys.modules["view_browser"] = module
        spec.loader.exec_module(module)
    return sys.modules["view_browser"]


@pytest.fixture(scope="module")
def context():
    """One headless Chromium for all tests of a file.

    Not for the session: while it is open, an event loop runs in this thread and no other test can run one.
    """
    browser = load_browser()
    missing = browser.why_not()
    if missing:
        pytest.skip(f"no page can be looked at: {missing}")
    with browser.chromium(width=480, height=300) as context:
        yield context


@pytest.fixture
def make_bundle():
    """Makes a plan like `bundle`, of any length: `(model, urdf, seconds, dt)`."""
    return planned


class Look:
    """Opens addresses, and closes every page at the end."""

    def __init__(self, context):
        self._context = context
        self._open = []

    def __call__(self, address: str):
        """A page of the view, ready."""
        view = load_browser().View(self._context, address)
        self._open.append(view)
        return view

    def bare(self, address: str):
        """Any other page."""
        page = self._context.new_page()
        self._open.append(page)
        page.goto(address)
        return page

    def close(self):
        for page in self._open:
            page.close()


@pytest.fixture
def look(context):
    look = Look(context)
    yield look
    look.close()


@pytest.fixture(scope="module")
def look_long(context):
    """The same, for a page that several tests look at."""
    look = Look(context)
    yield look
    look.close()
