"""A phase is one set of contacts, tasks and limits for a time; a script is a list of phases."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, final

from wbplan.errors import SpecError, listing
from wbplan.obstacles import Obstacle
from wbplan.paths import NUMBER, Path, as_path, name_of, number
from wbplan.problem.bodies import Body, Carried
from wbplan.problem.contacts import Contact, Push
from wbplan.problem.limits import Forces, JointLimits, Obstacles, SelfCollision, SupportPolygon
from wbplan.problem.objectives import ManipulabilityTask, Objective
from wbplan.problem.tasks import DampingTask, FrameTask, RelativePoseTask, Task, check_kind
from wbplan.state import State

Limit = JointLimits | SupportPolygon | SelfCollision | Obstacles | Forces
LIMITS = (JointLimits, SupportPolygon, SelfCollision, Obstacles, Forces)


def _tuple_of(items: Iterable[Any], kinds: type | tuple[type, ...], what: str) -> tuple[Any, ...]:
    if isinstance(items, str) or not isinstance(items, Iterable):
        raise SpecError(f"{what}: expected a list, got {items!r}")
    result = tuple(items)
    names = " or ".join(k.__name__ for k in (kinds if isinstance(kinds, tuple) else (kinds,)))
    for item in result:
        if not isinstance(item, kinds):
            raise SpecError(f"{what}: expected {names}, got {item!r}")
    return result


def _levels_of(soft: Iterable[Any], what: str) -> tuple[Any, ...]:
    """Soft tasks as given: tasks, or levels of them."""
    given = soft if isinstance(soft, str) or not isinstance(soft, Iterable) else tuple(soft)
    lists = [isinstance(item, list | tuple) for item in given] if isinstance(given, tuple) else []
    if not any(lists):
        return _tuple_of(given, Task, what)
    if not all(lists):
        raise SpecError(f"{what}: expected tasks, or levels that are lists of tasks; got both")
    levels = tuple(_tuple_of(level, Task, f"{what}[{k}]") for k, level in enumerate(given))
    for k, level in enumerate(levels):
        if not level:
            raise SpecError(f"{what}[{k}]: expected one task or more in a level, got none")
        stiff = [t.label for t in level if isinstance(t, DampingTask | ManipulabilityTask)]
        if k < len(levels) - 1 and stiff:
            raise SpecError(
                f"{what}[{k}]: {listing(stiff)} would forbid the levels below all motion; put it in the last"
            )
    return levels


def _mapping(given: Any, what: str, convert: Callable[[Any, str], Any]) -> Mapping[str, Any]:
    """A read-only copy: name -> value, checked."""
    if not isinstance(given, Mapping):
        raise SpecError(f"{what}: expected a mapping by name, got {given!r}")
    names = [name_of(name, f"{what}: key") for name in given]
    return MappingProxyType({name: convert(given[name], f"{what}['{name}']") for name in names})


def _driving(value: Any, what: str) -> Path:
    """The given motion of a joint."""
    path = as_path(value, what)
    if path.live:
        raise SpecError(f"{what}: a Live value may jump; give a PostureTask the Live target instead")
    if path.kind is not None:
        check_kind(path.kind, what, (NUMBER,))
    return path


def _unique(names: Sequence[str], what: str) -> None:
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise SpecError(f"{what}: named more than once: {', '.join(twice)}")


@final
@dataclass(frozen=True, eq=False)
class Phase:
    """What holds, what is asked and what limits it, for `duration` seconds.

    Args:
        name: for reports.
        contacts: feet that stay (hard) and span the support polygon.
        carried: bodies held by frames of the robot; each is a frame that tasks may name.
        hard: tasks met in full at every tick.
        soft: tasks met as well as their weights and everything else allow; or a list of such lists: levels
            in strict order, where a lower level never costs a higher one anything.
        limits: inequalities.
        duration: [s].
        roles: limb -> role, as the SRDF names them: the joints that the role holds are moved to its values
            over the phase and are not the QP's; unnamed limbs keep the role they are in.
        driven: joint -> path of its motion, from where it is when the phase begins; or a value, which it
            moves to over the phase. Such joints are not the QP's.
        locked: joints that stay as they are; not the QP's.
        pushes: forces with which frames push on what is around.

    Raises:
        SpecError: a field is not what it has to be.
    """

    name: str
    contacts: tuple[Contact, ...] = ()
    carried: tuple[Carried, ...] = ()
    hard: tuple[Task, ...] = ()
    soft: tuple[Task, ...] | tuple[tuple[Task, ...], ...] = ()
    limits: tuple[Limit, ...] = (JointLimits(),)
    duration: float = 1.0
    roles: Mapping[str, str] = field(default_factory=dict)
    driven: Mapping[str, Any] = field(default_factory=dict)
    locked: tuple[str, ...] = ()
    pushes: tuple[Push, ...] = ()

    def __post_init__(self) -> None:
        at = f"phase '{name_of(self.name, 'Phase.name')}'"
        put = partial(object.__setattr__, self)
        put("contacts", _tuple_of(self.contacts, Contact, f"{at}.contacts"))
        put("carried", _tuple_of(self.carried, Carried, f"{at}.carried"))
        put("hard", _tuple_of(self.hard, Task, f"{at}.hard"))
        put("soft", _levels_of(self.soft, f"{at}.soft"))
        put("limits", _tuple_of(self.limits, LIMITS, f"{at}.limits"))
        put("locked", _tuple_of(self.locked, str, f"{at}.locked"))
        put("pushes", _tuple_of(self.pushes, Push, f"{at}.pushes"))
        put("roles", _mapping(self.roles, f"{at}.roles", name_of))
        put("driven", _mapping(self.driven, f"{at}.driven", _driving))
        seconds = number(self.duration, f"{at}.duration", "a finite positive time in seconds", above=0.0)
        put("duration", seconds)
        _unique([c.frame for c in self.contacts], f"{at}.contacts")
        _unique([c.body.name for c in self.carried], f"{at}.carried")
        _unique([p.frame for p in self.pushes], f"{at}.pushes")
        rows = [t.label for t in self.tasks] + [f"contact({c.frame})" for c in self.contacts]
        _unique(rows, f"{at}: tasks (give name=...)")
        loops = {frozenset(pair) for pair in self.closures}
        for item in self.carried:
            if item.grip is not None and frozenset((item.by, item.grip.by)) not in loops:
                raise SpecError(
                    f"{at}.carried: '{item.body.name}' is clamped by '{item.by}' and '{item.grip.by}', which "
                    "nothing holds together; add to hard "
                    f"wb.RelativePoseTask('{item.grip.by}', root='{item.by}')"
                )
        both = sorted(set(self.driven) & set(self.locked))
        if both:
            raise SpecError(f"{at}: joints both driven and locked: {', '.join(both)}")
        for kind in LIMITS:
            if sum(isinstance(limit, kind) for limit in self.limits) > 1:
                raise SpecError(f"{at}.limits: more than one {kind.__name__}")
        if any(isinstance(t, DampingTask) for t in self.hard):
            raise SpecError(f"{at}.hard: a damping task forbids all motion; put it in soft")
        objectives = [t.label for t in self.hard if isinstance(t, Objective)]
        if objectives:
            raise SpecError(
                f"{at}.hard: {listing(objectives)} has no target to be met in full; put it in soft"
            )

    @property
    def levels(self) -> tuple[tuple[Task, ...], ...]:
        """The soft tasks by level, the highest first; one level where `soft` is a plain list."""
        soft: tuple[Any, ...] = self.soft
        return soft if soft and isinstance(soft[0], tuple) else (soft,)

    @property
    def soft_tasks(self) -> tuple[Task, ...]:
        """The soft tasks of all levels, the highest level first."""
        return tuple(task for level in self.levels for task in level)

    @property
    def tasks(self) -> tuple[Task, ...]:
        """Hard, then soft tasks."""
        return (*self.hard, *self.soft_tasks)

    @property
    def margin(self) -> float | None:
        """The promised stability margin [m]; `None` where the phase promises none."""
        polygon = self.support
        return None if polygon is None else polygon.margin

    @property
    def support(self) -> SupportPolygon | None:
        """The support polygon limit, if the phase has one."""
        return next((limit for limit in self.limits if isinstance(limit, SupportPolygon)), None)

    @property
    def joint_limits(self) -> JointLimits | None:
        """The joint limits, if the phase has them."""
        return next((limit for limit in self.limits if isinstance(limit, JointLimits)), None)

    @property
    def self_collision(self) -> SelfCollision | None:
        """The limit that keeps the robot from itself, if the phase has it."""
        return next((limit for limit in self.limits if isinstance(limit, SelfCollision)), None)

    @property
    def forces(self) -> Forces | None:
        """The limit on contact forces and torques, if the phase has one."""
        return next((limit for limit in self.limits if isinstance(limit, Forces)), None)

    @property
    def obstacles(self) -> Obstacles | None:
        """The limit that keeps the robot from what stands in the world, if the phase has it."""
        return next((limit for limit in self.limits if isinstance(limit, Obstacles)), None)

    @property
    def clearance(self) -> float | None:
        """The promised distance [m], the least where there are two; `None` where the phase promises none."""
        promised = [limit.distance for limit in (self.self_collision, self.obstacles) if limit is not None]
        return min(promised, default=None)

    @property
    def loops(self) -> tuple[RelativePoseTask, ...]:
        """Hard tasks that hold the relative pose of two frames at one value in all six axes."""
        return tuple(
            t
            for t in self.hard
            if isinstance(t, RelativePoseTask)
            and t.path.constant
            and (t.position_weight > 0).all()
            and (t.rotation_weight > 0).all()
        )

    @property
    def closures(self) -> tuple[tuple[str, str], ...]:
        """The pairs (root, frame) of `loops`; a carried body stands for the frame that holds it."""
        holder = {c.body.name: c.by for c in self.carried}
        pairs = [(holder.get(t.root, t.root), holder.get(t.frame, t.frame)) for t in self.loops]
        return tuple((root, frame) for root, frame in pairs if root != frame)

    @property
    def frame_tasks(self) -> tuple[FrameTask, ...]:
        """Hard, then soft tasks on frames."""
        return tuple(t for t in self.tasks if isinstance(t, FrameTask))


@final
@dataclass(frozen=True, eq=False, init=False)
class Script:
    """Phases in order, each starting where the one before ended.

    Args:
        phases: one or more, their names all different.
        bodies: objects to show that no phase carries, or that stand somewhere before they are carried.
        start: the state or the name of the pose that it starts in, unless `plan` is told another.
    """

    phases: tuple[Phase, ...]
    bodies: tuple[Body, ...]
    start: State | str

    def __init__(
        self, *phases: Phase | Iterable[Phase], bodies: Iterable[Body] = (), start: State | str = "stand"
    ) -> None:
        if not isinstance(start, State | str):
            raise SpecError(f"Script.start: expected a State or the name of a pose, got {start!r}")
        flat: list[Phase] = []
        for item in phases:
            flat.extend([item] if isinstance(item, Phase) else _tuple_of(item, Phase, "Script"))
        if not flat:
            raise SpecError("Script: expected one or more phases, got none")
        _unique([p.name for p in flat], "Script: phases")
        known: dict[str, Body] = {}
        for body in [*_tuple_of(bodies, Body, "Script.bodies"), *(c.body for p in flat for c in p.carried)]:
            if not known.setdefault(body.name, body).same_as(body):
                raise SpecError(f"Script: two different bodies are named '{body.name}'")
        _one_world(flat)
        object.__setattr__(self, "phases", tuple(flat))
        object.__setattr__(self, "bodies", tuple(known.values()))
        object.__setattr__(self, "start", start)

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """What stands in the world in any phase, each once."""
        limits = (p.obstacles for p in self.phases)
        return tuple({item.name: item for limit in limits if limit for item in limit.shapes}.values())

    @property
    def duration(self) -> float:
        """Sum of the phases' durations [s]."""
        return sum(p.duration for p in self.phases)


def _one_world(phases: Sequence[Phase]) -> None:
    """One name, one obstacle."""
    known: dict[str, Obstacle] = {}
    for item in (item for phase in phases if phase.obstacles for item in phase.obstacles.shapes):
        other = known.setdefault(item.name, item)
        if other is not item and not other.same_as(item):
            raise SpecError(f"Script: two different obstacles are named '{item.name}'")


def unknown(kind: str, name: str, valid: Iterable[str]) -> SpecError:
    """The error for a name that does not exist."""
    return SpecError(f"{kind} '{name}' does not exist; there are: {listing(list(valid))}")
