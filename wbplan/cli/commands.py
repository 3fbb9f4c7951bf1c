"""The command line: list, run, check, simulate, view, robot, gaits, papers.

Exit codes: 0 done, and every promise holds; 1 a promise is broken, no plan exists, or it does not stand;
2 bad usage or bad input, told on stderr without a traceback; 130 interrupted.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from wbplan import catalog
from wbplan.bundle import Bundle, is_bundle
from wbplan.checks import check as recompute
from wbplan.cli.live import LiveView
from wbplan.cli.printing import print_plan, print_robot, print_simulation
from wbplan.cli.survey import setting, survey, table
from wbplan.errors import BundleError, CheckFailed, GaitError, PlanFalls, SolveError, SpecError, WbplanError
from wbplan.gaits import cycle_figure, gaits_for, mode_named
from wbplan.papers import DIFFERS, figure_16, report, summary
from wbplan.physics import ghost_of
from wbplan.physics import simulate as replay
from wbplan.planner import plan
from wbplan.problem.script import Script
from wbplan.robot import Robot, load_robot
from wbplan.taskfile import glance, load_task
from wbplan.tick import Loop
from wbplan.version import VERSION
from wbplan.view import Server, play

DONE, BROKEN, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
HOST = "127.0.0.1"
Meshes = Annotated[
    list[Path] | None, typer.Option(metavar="FOLDER", help="Where the robot's meshes are; may be repeated.")
]

app = typer.Typer(
    name="wbplan",
    help="Whole-body motion plans for legged robots: planned, checked, and shown.",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class Backend(StrEnum):
    """The solvers to choose from."""

    proxqp = "proxqp"
    placo = "placo"


def main(args: Sequence[str] | None = None) -> int:
    """Runs the command line.

    Args:
        args: without the program's name; those of the process where `None`.

    Returns:
        The exit code.
    """
    given = list(sys.argv[1:] if args is None else args) or ["--help"]
    if args is None:
        signal.signal(signal.SIGTERM, _terminated)
    try:
        command = typer.main.get_command(app)  # not .main(): it has exit codes of its own
        with command.make_context("wbplan", given) as context:
            command.invoke(context)
        sys.stdout.flush()
        return DONE
    except typer.Exit as leave:  # --help, --version
        return leave.exit_code
    except typer.TyperException as error:  # bad usage
        hint = f"; see: wbplan {given[0]} --help" if given[0] in _commands() else "; see: wbplan --help"
        return _say(_in_one_line(error) + hint, BAD_INPUT)
    except SolveError as error:
        return _say(f"no plan exists: {error}", BROKEN)
    except GaitError as error:
        return _say(f"no walk exists: {error}", BROKEN)
    except (CheckFailed, PlanFalls) as error:
        return _say(str(error), BROKEN)
    except WbplanError as error:
        return _say(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        return _say("interrupted", INTERRUPTED)
    except BrokenPipeError:  # the reader, `head` say, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains again at exit
        return DONE
    except OSError as error:
        return _say(str(error), BAD_INPUT)


@app.callback(invoke_without_command=True)
def _options(
    version: Annotated[bool, typer.Option("--version", help="Print the version and leave.")] = False,
) -> None:
    if version:
        print(f"wbplan {VERSION}")
        raise typer.Exit(DONE)


@app.command("list")
def list_(
    task: Annotated[str | None, typer.Argument(help="A task, to see what `--set` takes.")] = None,
) -> None:
    """Tasks and robots, one line each; of a TASK its parameters."""
    if task is not None:
        file = load_task(task)
        print("\n".join([file.docstring, "", "parameters", *(f"  {p}" for p in file.parameters)]))
        return
    print("tasks")
    for name, path in catalog.tasks().items():
        try:
            robot, summary = glance(path)
        except SpecError as error:
            robot, summary = "?", f"broken: {error}"
        print(f"  {name:<20} {robot:<20} {summary}")
    print("robots")
    for name, path in catalog.robots().items():
        print(f"  {name:<20} {path}")


@app.command()
def run(
    task: Annotated[str, typer.Argument(help="A task's name, or a path to a task file.")],
    out: Annotated[Path | None, typer.Option(help="Folder of the bundle; out/TASK where not given.")] = None,
    backend: Annotated[Backend, typer.Option(help="The solver.")] = Backend.proxqp,
    dt: Annotated[float, typer.Option(help="Time from one sample to the next, in seconds.")] = 0.01,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="A parameter of the task; may be repeated."),
    ] = None,
    robot_name: Annotated[
        str | None, typer.Option("--robot", metavar="ROBOT", help="Another robot, if the task takes others.")
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Serve the plan in Meshcat until Ctrl-C.")] = False,
    partial: Annotated[
        Path | None, typer.Option(help="Folder for the plan up to where it fails, if it does.")
    ] = None,
) -> None:
    """Plan a task, write its bundle, and check every promise of it."""
    file = load_task(task)
    values = file.values(settings or [])
    folder = out if out is not None else Path("out") / file.name
    for place in (folder, partial):
        if place is not None:
            _require_place(place)

    robot = load_robot(file.robot_for(robot_name))
    script = file.script(robot, values)
    with (
        _live_view(robot, script, view) as observe,
        _progress_bar(file.name) as progress,
        _kept(partial),
    ):
        planned = plan(
            robot,
            script,
            dt=dt,
            backend=backend.value,
            task=file.name,
            parameters=values,
            progress=progress,
            observe=observe,
        )
        planned.save(folder)
    saved = Bundle.read(folder)  # what was written is what is checked
    meshes = (robot.urdf_path.parent, *robot.package_dirs)
    checked = recompute(saved, folders=meshes)
    console = _console()
    print_plan(saved, console)
    console.print(checked.table())
    console.print(
        f"written to {folder}; view it: wbplan view {folder}, or open {folder / 'scene.html'}", soft_wrap=True
    )
    checked.require()
    if view:
        play(saved, HOST, package_dirs=meshes)


@app.command()
def check(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A bundle, as `wbplan run` writes it.")],
    meshes: Meshes = None,
) -> None:
    """Recompute every promise of a bundle from its files; exit code 1 where one is broken."""
    bundle = Bundle.read(folder)
    checked = recompute(bundle, folders=meshes or ())
    console = _console()
    console.print(checked.table())
    if reason := bundle.plan["report"].get("incomplete"):
        console.print(f"incomplete: it ends where no step was found: {reason}", soft_wrap=True)
    checked.require()


@app.command()
def simulate(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A bundle, as `wbplan run` writes it.")],
    trials: Annotated[
        int, typer.Option(min=0, help="As many more replays, each with everything a little off.")
    ] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of the trials.")] = 0,
    view: Annotated[
        bool, typer.Option("--view", help="Serve plan and simulated robot in Meshcat until Ctrl-C.")
    ] = False,
    meshes: Meshes = None,
) -> None:
    """Replay a bundle with contact, friction and servos; exit code 1 where it does not stand."""
    bundle = Bundle.read(folder)
    with _progress_bar(str(folder)) as progress:
        done = replay(bundle, trials=trials, seed=seed, progress=progress, folders=meshes or ())
    if Bundle.read(folder).plan != bundle.plan:
        raise BundleError(f"{folder}: was replaced while it was simulated; simulate it again")
    report = done.save(folder)
    print_simulation(done, _console())
    print(f"written to {report}")
    if view:
        play(bundle, HOST, ghost=ghost_of(done), package_dirs=meshes or ())
    if not done.stands:
        raise PlanFalls(str(done.verdict))


@app.command()
def view(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A bundle, as `wbplan run` writes it.")],
    host: Annotated[str, typer.Option(help="Address to listen on.")] = HOST,
    port: Annotated[
        int | None, typer.Option(min=1, max=65535, help="Port to listen on; a free one where not given.")
    ] = None,
    collisions: Annotated[
        bool, typer.Option("--collisions", help="Also draw the collision shapes and the nearest pair.")
    ] = False,
    meshes: Meshes = None,
) -> None:
    """Serve a bundle in Meshcat until Ctrl-C."""
    play(Bundle.read(folder), host, port, collisions=collisions, package_dirs=meshes or ())


@app.command()
def robot(
    name_or_path: Annotated[str, typer.Argument(help="A robot's name, or a path to a URDF.")],
) -> None:
    """Summary of a robot: limbs, frames, mass, limits, and the problems found."""
    print_robot(load_robot(name_or_path), _console())


@app.command()
def gaits(
    robot_name: Annotated[str, typer.Argument(metavar="ROBOT", help="A robot's name, or a path to a URDF.")],
    names: Annotated[
        list[str] | None, typer.Argument(metavar="GAIT ...", help="All where not given.")
    ] = None,
    mode: Annotated[str, typer.Option(help="free, crab, ant, mixed1 or mixed2.")] = "free",
    cycles: Annotated[float, typer.Option(min=0.1, help="How far to walk, in strides.")] = 2.0,
    figure: Annotated[
        Path | None, typer.Option(help="A PNG file for the margins over a cycle of every gait.")
    ] = None,
) -> None:
    """Walk every gait of a robot: speed, distance, margin, slip and clearance, planned and measured."""
    loaded, way = load_robot(robot_name), mode_named(mode)
    if figure is not None:
        chosen = [setting(loaded, name, way) for name in names or gaits_for(loaded, way)]
        shown = [(one.gait, one.stance.feet, one.stroke) for one in chosen]
        cycle_figure(shown, way.heading, f"{loaded.name}, {way.name}").savefig(figure, dpi=110)
    rows = list(survey(loaded, names, mode=way, cycles=cycles))
    _console().print(table(rows, f"{loaded.name}, {way.name}: {cycles:g} cycles of every gait"))
    broken = [row.gait for row in rows if not row.held]
    if broken:
        raise CheckFailed(f"promises are broken in {', '.join(broken)}", broken)


@app.command()
def papers(
    paper: Annotated[
        str | None, typer.Argument(help="mana, zheng, hexpiderix, hiphant or zhuang; all where not given.")
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(help="A PNG file for the margins of a change of gait beside Zheng's figure 16."),
    ] = None,
) -> None:
    """What the papers print about kinematics beside what comes out here; exit code 1 where that differs."""
    if figure is not None:
        figure_16().savefig(figure, dpi=110)
    rows = report(paper)
    _console().print(summary([row.cells() for row in rows]))
    counts = {
        verdict: [r.verdict for r in rows].count(verdict) for verdict in sorted({r.verdict for r in rows})
    }
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
    wrong = [f"{r.paper}, {r.table}: {r.what}" for r in rows if r.verdict == DIFFERS]
    if wrong:
        raise CheckFailed(f"{len(wrong)} numbers differ from the print: {'; '.join(wrong)}", wrong)


def _commands() -> set[str]:
    return {str(c.name or getattr(c.callback, "__name__", "")) for c in app.registered_commands}


class _Console(Console):
    def on_broken_pipe(self) -> None:
        raise BrokenPipeError  # rich would leave with exit code 1


def _console() -> Console:
    """Standard output; wide enough for the tables where it is a file or a pipe."""
    plain: dict[str, Any] = {"highlight": False, "markup": False, "emoji": False}  # brackets are units here
    console = _Console(**plain)
    return console if console.is_terminal else _Console(**plain, width=120)


def _in_one_line(error: typer.TyperException) -> str:
    return " ".join(error.format_message().replace("Value error, ", "").split()).rstrip(".")


def _say(message: str, code: int) -> int:
    print(f"wbplan: {message}", file=sys.stderr)
    return code


def _terminated(signum: int, frame: Any) -> None:
    """Ends as Ctrl-C does: temporary folders are removed, servers are closed."""
    raise KeyboardInterrupt


def _require_place(folder: Path) -> None:
    """Refuses a folder that cannot be written before any time is spent on planning.

    Raises:
        BundleError: it is a file, holds something that is not a bundle, or cannot be made.
    """
    try:
        if folder.is_dir():
            if any(folder.iterdir()) and not is_bundle(folder):
                raise BundleError(
                    f"'{folder}' holds files but no bundle; expected a new folder, or a bundle to replace"
                )
            above = folder.absolute().parent
        else:
            above = next(p for p in (folder.absolute(), *folder.absolute().parents) if p.exists())
            if not above.is_dir():
                raise BundleError(f"cannot write to '{folder}': '{above}' is a file, expected a folder")
        if not os.access(above, os.W_OK | os.X_OK):
            raise BundleError(f"cannot write to '{folder}': no permission to write in '{above}'")
    except OSError as error:
        raise BundleError(f"cannot write to '{folder}': {error.strerror or error}") from None


@contextmanager
def _kept(folder: Path | None) -> Iterator[None]:
    """Writes what was planned before a failure, where a folder is given for it."""
    try:
        yield
    except SolveError as error:
        if folder is None or error.partial is None:
            raise
        error.partial.save(folder)
        raise SolveError(
            f"{error}; the plan until then is in {folder}", error.clashes, error.limits
        ) from None


@contextmanager
def _live_view(robot: Robot, script: Script, wanted: bool) -> Iterator[Callable[[Loop, float], None] | None]:
    """An observer that draws the plan while it is made, on a page of its own; none where not wanted."""
    if not wanted:
        yield None
        return
    with Server(HOST, title=f"{robot.name}, being planned") as server:
        print(f"watch it being planned: {server.url}", flush=True)
        yield LiveView(server, robot, script)


@contextmanager
def _progress_bar(title: str) -> Iterator[Callable[[float, str], None]]:
    """A bar on stderr that a callback `(share done 0..1, phase)` moves; nothing where that is no terminal."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f}%"))
    with Progress(
        *columns, TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task(title, total=1.0)

        def moved(share: float, phase: str) -> None:
            bar.update(task, completed=share, description=f"{title}: {phase}")

        yield moved
