"""Commands for robots connected by messages: ``robot`` simulates, ``drive`` controls one."""

import logging
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.console import Console

from experiments.command_options import (
    Bus,
    BusUrl,
    Drawn,
    Quiet,
    TimedScenario,
    folder_or,
    open_bus,
)
from experiments.outcomes import judge_run, number_table, print_line, print_run
from pfsc_drake.errors import InputError
from reporting.progress import ProgressDisplay
from reporting.terminal import FAULT, interruptible

if TYPE_CHECKING:
    from experiments.hardware.driven_run import FirstCommand
    from experiments.hardware.statics import StaticCheck


@dataclass
class DriverChoices:
    """Options of a simulated driver."""

    expire: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Age at which commands expire. Default: the driver's, 0.1 or 0.05",
        ),
    ] = None
    low_pass: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            help="Low-pass filter of commanded torques, 0 for none. Default: driver.low_pass or 30",
        ),
    ] = None
    damping: Annotated[
        float,
        typer.Option(metavar="1/S", help="Damping rate of the joints while no command is valid."),
    ] = 10.0


@dataclass
class LinkOptions:
    """Packet loss and delay of the link."""

    lose: Annotated[float, typer.Option(metavar="SHARE", help="Share of lost packets.")] = 0.0
    delay: Annotated[int, typer.Option(metavar="SAMPLES", help="Delay of commands in samples.")] = 0


def robot_command(
    *,
    bus: Bus,
    rules: DriverChoices,
    link: LinkOptions,
    chosen: TimedScenario,
    meshcat: Annotated[
        bool, typer.Option("--meshcat/--no-meshcat", help="Draw the robot in Meshcat.")
    ] = True,
) -> None:
    """Simulate the robot of a scenario in real time: plant, friction, sensors, driver."""
    from diagrams.scenario import Scenario
    from experiments.hardware.driven_run import real_time_priority
    from experiments.hardware.simulated_robot import Transport, run_robot_scenario
    from pfsc_drake.drivers.driver_rules import DriverOptions
    from pfsc_drake.drivers.link import RobotEndpoint
    from pfsc_drake.drivers.messages import dialect
    from pfsc_drake.yaml.typed import load_typed

    seconds = chosen.seconds or math.inf
    with interruptible():
        loaded, messages, low_pass = chosen.read(), dialect(bus.driver), rules.low_pass
        if low_pass is None:
            own = load_typed(Scenario, loaded.data, loaded.source).driver.low_pass
            low_pass = own or DriverOptions.low_pass
        expiry = messages.expiry if rules.expire is None else rules.expire
        options = DriverOptions(expiry, low_pass, damping=rules.damping)
        transport = Transport(link.lose, link.delay)
        with real_time_priority():
            end = RobotEndpoint(open_bus(bus.lcm), messages)
        run_robot_scenario(
            loaded, end, options, transport, duration=seconds, drawn=meshcat, notify=_print_line
        )


def lead_command(
    *,
    lcm: BusUrl = "",
    chosen: TimedScenario,
) -> None:
    """Simulate the operator of a teleoperation scenario; the follower is another process."""
    from experiments.hardware.leader_process import lead_scenario

    seconds = chosen.seconds
    with interruptible():
        summary = lead_scenario(chosen.read(), open_bus(lcm), duration=seconds, notify=_print_line)
        _print_line(
            f"led for {summary.duration:g} s, up to {summary.travel:.3g} m away; "
            f"{summary.received} messages received from the follower; largest force "
            f"{summary.largest_force:.3g} N; least energy in the tank {summary.least_tank:.3g} J"
        )


def _print_line(line: str) -> None:
    print_line(Console(), line)


@dataclass
class Driving:
    """Options of driving or checking a robot."""

    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Check the robot, print the first command, send nothing."),
    ] = False
    check: Annotated[
        bool,
        typer.Option(
            "--check", help="Compare joint torques with the model; sends nothing without --move."
        ),
    ] = False
    move: Annotated[
        float,
        typer.Option(
            metavar="DEG", help="With --check: amplitude of a slow motion of each joint; 0.5 to 20."
        ),
    ] = 0.0
    override: Annotated[
        float,
        typer.Option(metavar="SHARE", help="Initial speed scaling of the reference, 0.01 to 1.5."),
    ] = 1.0
    native: Annotated[
        bool,
        typer.Option("--native", help="Run the controller as C code, compiled with gcc first."),
    ] = False


def drive_command(
    *,
    bus: Bus,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results. Default: out/SCENARIO_driven")
    ] = None,
    driving: Driving,
    chosen: TimedScenario,
    drawn: Drawn,
    quiet: Quiet = False,
) -> None:
    """Run the controller of a scenario on a robot.

    Ctrl-C brings it to rest. This is no safety function.
    """
    from experiments.hardware.driven_run import (
        DriveOptions,
        drive_scenario,
        first_command,
        real_time_priority,
    )
    from experiments.hardware.keys import KEYS, DriveKeys, pressed_keys
    from experiments.hardware.slow_motion import check_scenario
    from pfsc_drake.drivers.link import ControllerEndpoint
    from pfsc_drake.drivers.messages import dialect

    seconds = chosen.seconds
    with interruptible():
        loaded = chosen.read()
        folder = folder_or(out, f"{loaded.name}_driven")
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        # LCM's receiving thread gets the priority, too
        with real_time_priority():
            end = ControllerEndpoint(open_bus(bus.lcm), dialect(bus.driver))
        console = Console(quiet=quiet)
        if driving.move and not driving.check:
            raise InputError(f"--move {driving.move:g}: without --check; allowed: together with it")
        if driving.check:
            with ProgressDisplay(console, loaded.name, None) as progress:
                found = check_scenario(loaded, end, progress, driving.move)
            _print_check(console, found)
            raise typer.Exit(0 if found.is_good else FAULT)
        options = DriveOptions(
            seconds, driving.override, driving.native, drawn.figures, drawn.recording
        )
        keys = DriveKeys()
        with (
            pressed_keys() as pressed,
            ProgressDisplay(console, loaded.name, seconds) as progress,
        ):
            if sys.stdin.isatty():
                console.print(KEYS, style="dim")
            if driving.dry_run:
                _print_first(console, first_command(loaded, end, folder, options, progress))
                raise typer.Exit(0)
            outcome = drive_scenario(
                loaded,
                end,
                folder,
                options,
                progress,
                requests=lambda share: keys.requests(pressed(), share),
            )
        print_run(console, outcome)
        raise typer.Exit(judge_run(outcome, folder, progress.simulated_time))


def _print_check(console: Console, found: "StaticCheck") -> None:
    """Print measured and expected joint torques, and the largest differences."""
    along = ("Largest along the motion [Nm]",) if len(found.q) > 1 else ()
    titles = ("Joint", "Position [deg]", "Measured [Nm]", "Model [Nm]", "Difference [Nm]", *along)
    table = number_table(*titles)
    off = found.measured - found.expected
    columns = [np.rad2deg(found.q[0]), found.measured[0], found.expected[0], off[0]]
    columns += [np.nanmax(np.abs(off[1:]), axis=0)] if along else []
    for i, values in enumerate(np.column_stack(columns)):
        table.add_row(str(i + 1), f"{values[0]:.2f}", *(f"{value:.3f}" for value in values[1:]))
    console.print(table)
    _print_line(found.verdict)


def _print_first(console: Console, first: "FirstCommand") -> None:
    """Print the first command to the robot."""
    unit = "Nm, on top of its weight" if first.kind == "TORQUE" else "rad/s"
    table = number_table("Joint", f"First {first.kind.lower()} [{unit}]")
    for i, value in enumerate(np.asarray(first.values)):
        table.add_row(str(i + 1), f"{value:.4f}")
    console.print("the robot matches the scenario, at rest and at its start; nothing was sent")
    console.print(table)
