"""Commands for robots behind messages: ``robot`` is one, simulated; ``drive`` drives one."""

import logging
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from experiments.command_options import (
    Driver,
    Duration,
    Figures,
    Lcm,
    Overrides,
    Quiet,
    Recording,
    ScenarioName,
    open_bus,
    read_duration,
)
from experiments.outcomes import judge_run, print_run
from experiments.scenario_file import expand_home, read_scenario
from pfsc_drake.errors import InputError
from reporting.progress import ProgressDisplay
from reporting.terminal import FAULT, interruptible

if TYPE_CHECKING:
    from experiments.hardware.driven_run import FirstCommand
    from experiments.hardware.statics import StaticCheck


def robot_command(
    scenario: ScenarioName,
    lcm: Lcm = "",
    driver: Driver = "panda",
    expire: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Age from which commands count no more. Default: the driver's, 0.1 or 0.05",
        ),
    ] = None,
    low_pass: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            help="Low pass of commanded torques; 0 for none. Default: driver.low_pass, or 30",
        ),
    ] = None,
    damping: Annotated[
        float,
        typer.Option(
            metavar="1/S", help="Rate with which joints lose their speed while no command counts."
        ),
    ] = 10.0,
    lose: Annotated[
        float, typer.Option(metavar="SHARE", help="Share of packets that are lost.")
    ] = 0.0,
    delay: Annotated[
        int, typer.Option(metavar="TICKS", help="Ticks by which commands come later.")
    ] = 0,
    overrides: Overrides = None,
    duration: Duration = None,
    meshcat: Annotated[
        bool, typer.Option("--meshcat/--no-meshcat", help="Draw the robot in Meshcat.")
    ] = True,
) -> None:
    """Be the robot of a scenario: plant, friction, sensors and a driver's rules, in real time."""
    from diagrams.scenario import Scenario
    from experiments.hardware.driven_run import real_time_priority
    from experiments.hardware.robot import Transport
    from experiments.hardware.robot_run import run_robot_scenario
    from pfsc_drake.drivers.driver_rules import DriverOptions
    from pfsc_drake.drivers.link import RobotEnd
    from pfsc_drake.drivers.messages import dialect
    from pfsc_drake.yaml.typed import load_typed

    seconds = math.inf if duration is None else read_duration(duration)
    with interruptible():
        loaded = read_scenario(scenario, overrides or [])
        messages = dialect(driver)
        if low_pass is None:
            own = load_typed(Scenario, loaded.data, str(loaded.path)).driver.low_pass
            low_pass = own or DriverOptions.low_pass
        expiry = messages.expiry if expire is None else expire
        options = DriverOptions(expiry, low_pass, damping=damping)
        transport = Transport(lose, delay)
        with real_time_priority():
            end = RobotEnd(open_bus(lcm), messages)
        console = Console()
        run_robot_scenario(
            loaded,
            end,
            options,
            transport,
            duration=seconds,
            drawn=meshcat,
            tell=lambda line: console.print(line, soft_wrap=True, highlight=False, markup=False),
        )


def lead_command(
    scenario: ScenarioName,
    lcm: Lcm = "",
    overrides: Overrides = None,
    duration: Duration = None,
) -> None:
    """Be the operator of a scenario that is led from afar, its follower in another process."""
    from experiments.hardware.lead import lead_scenario

    seconds = None if duration is None else read_duration(duration)
    with interruptible():
        console = Console()
        led = lead_scenario(
            read_scenario(scenario, overrides or []),
            open_bus(lcm),
            duration=seconds,
            tell=lambda line: console.print(line, soft_wrap=True, highlight=False, markup=False),
        )
        console.print(
            f"led for {led.duration:g} s, up to {led.way:.3g} m away; {led.received} messages of "
            f"the follower; up to {led.largest_force:.3g} N felt; never less than "
            f"{led.least_tank:.3g} J in the tank",
            soft_wrap=True,
            highlight=False,
        )


def drive_command(
    scenario: ScenarioName,
    lcm: Lcm = "",
    driver: Driver = "panda",
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results. Default: out/SCENARIO_driven")
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Check the robot, tell the first command, send nothing."),
    ] = False,
    check: Annotated[
        bool,
        typer.Option("--check", help="Compare torques with the model's; send nothing by itself."),
    ] = False,
    move: Annotated[
        float,
        typer.Option(
            metavar="DEG", help="With --check: moves each joint so far, slowly; 0.5 to 20."
        ),
    ] = 0.0,
    override: Annotated[
        float,
        typer.Option(metavar="SHARE", help="Of the reference's speed at first, 0.01 to 1.5."),
    ] = 1.0,
    native: Annotated[
        bool,
        typer.Option("--native", help="Let the controller drive in C, compiled with gcc first."),
    ] = False,
    overrides: Overrides = None,
    duration: Duration = None,
    figures: Figures = True,
    recording: Recording = True,
    quiet: Quiet = False,
) -> None:
    """Drive a robot by a scenario: Ctrl-C brings it to rest. This is no safety function."""
    from experiments.hardware.driven_run import check_scenario, drive_scenario, real_time_priority
    from experiments.hardware.keys import KEYS, DriveKeys, pressed_keys
    from pfsc_drake.drivers.link import ControllerEnd
    from pfsc_drake.drivers.messages import dialect

    seconds = None if duration is None else read_duration(duration)
    with interruptible():
        loaded = read_scenario(scenario, overrides or [])
        folder = expand_home(out) if out is not None else Path("out") / f"{loaded.name}_driven"
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        # the thread of LCM that hears goes first, too
        with real_time_priority():
            end = ControllerEnd(open_bus(lcm), dialect(driver))
        console = Console(quiet=quiet)
        if move and not check:
            raise InputError(f"--move {move:g}: without --check; allowed: together with it")
        if check:
            with ProgressDisplay(console, loaded.name, None) as progress:
                found = check_scenario(loaded, end, progress, move)
            _print_check(console, found)
            raise typer.Exit(0 if found.is_good else FAULT)
        keys = DriveKeys()
        with (
            pressed_keys() as pressed,
            ProgressDisplay(console, loaded.name, seconds) as progress,
        ):
            if sys.stdin.isatty():
                console.print(KEYS, style="dim")
            outcome = drive_scenario(
                loaded,
                end,
                out=folder,
                duration=seconds,
                figures=figures,
                recording=recording,
                progress=progress,
                override=override,
                asked=lambda share: keys.requests(pressed(), share),
                native=native,
                dry_run=(lambda first: _print_first(console, first)) if dry_run else None,
            )
        if outcome is None:
            raise typer.Exit(0)
        print_run(console, outcome)
        raise typer.Exit(judge_run(outcome, folder, progress.simulated_time))


def _print_check(console: Console, found: "StaticCheck") -> None:
    """Print what a robot measures at rest beside what it should, and how far off it is at most."""
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    along = ("Largest along the motion [Nm]",) if len(found.q) > 1 else ()
    titles = ("Joint", "Position [deg]", "Measured [Nm]", "Model [Nm]", "Difference [Nm]", *along)
    for title in titles:
        table.add_column(title, justify="right")
    off = found.measured - found.expected
    columns = [np.rad2deg(found.q[0]), found.measured[0], found.expected[0], off[0]]
    columns += [np.nanmax(np.abs(off[1:]), axis=0)] if along else []
    for i, values in enumerate(np.column_stack(columns)):
        table.add_row(str(i + 1), f"{values[0]:.2f}", *(f"{value:.3f}" for value in values[1:]))
    console.print(table)
    Console().print(found.verdict, soft_wrap=True, highlight=False, markup=False)


def _print_first(console: Console, first: "FirstCommand") -> None:
    """Print what the robot would be told first."""
    unit = "Nm, on top of its weight" if first.kind == "TORQUE" else "rad/s"
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    table.add_column("Joint", justify="right")
    table.add_column(f"First {first.kind.lower()} [{unit}]", justify="right")
    for i, value in enumerate(np.asarray(first.values)):
        table.add_row(str(i + 1), f"{value:.4f}")
    console.print("the robot is the scenario's, at rest and at its start; nothing was sent")
    console.print(table)
