"""The tick beside its peers: the same stack, path and machine for each of them, in one run.

    python -m wbplan.bench [--out out/bench.json] [--ticks 2000] [--stack clamp] [--profile]

Two stacks (see `scenes`), and the solvers (see `solvers`):

- `kinematics-floor`: Pinocchio alone, what no tick can do without;
- `placo`: PlaCo's own solver, written by hand as its users would;
- `pink`: Pink's `solve_ik`, asked the same as far as it goes; needs the extra `bench`;
- `wbplan-proxqp`, `wbplan-placo`: `wbplan.Loop.step`, with everything it does.

Rounds take turns (A B C A B C), so that a machine that slows down slows all of them. Every tick is timed for
itself, on the wall clock, with one thread and the garbage collector off. Afterwards the configurations are
measured: a solver that does not follow the path, or lets a foot slip, has not done the same work.
"""

from wbplan.bench.race import Lap, race
from wbplan.bench.report import Row, rows_of, table_of, write_json
from wbplan.bench.scenes import SCENES, Scene
from wbplan.bench.solvers import make_solvers

__all__ = ["SCENES", "Lap", "Row", "Scene", "make_solvers", "race", "rows_of", "table_of", "write_json"]
