"""A controller in C on the bench: statuses of a run, changed, and what it answers."""

import subprocess
from dataclasses import replace
from functools import cached_property

import numpy as np
from pydrake.lcm import DrakeLcm

from diagrams.robot_station import build_robot_station
from diagrams.scenario import Scenario
from experiments.hardware.drive import Drive
from experiments.hardware.driven_run import prepare_driven
from experiments.hardware.native_project import write_native
from experiments.hardware.native_record import NativeRun, RepeatedDrive
from experiments.hardware.simulated_robot import SimulatedRobot, Transport
from experiments.scenario_file import read_scenario
from pfsc_drake.drivers.driver_rules import DriverOptions
from pfsc_drake.drivers.link import ControllerEndpoint, RobotEndpoint
from pfsc_drake.drivers.messages import dialect
from pfsc_drake.yaml.typed import load_typed


def quiet(*_):
    """Tell nobody of progress."""


class Bench:
    """The controller of a scenario in C, and statuses of its robot.

    Args:
        folder: Where the C goes.
        name: Name of the scenario.
        changes: Its keys that are changed.
        kind: Whose messages.
    """

    def __init__(self, folder, name, changes, kind="panda"):
        self.folder, self.dialect = folder, dialect(kind)
        self.scenario = read_scenario(name, list(changes))
        self.prepared = prepare_driven(self.scenario, None, recording=False, progress=quiet)

    def make_drive(self, end):
        """Return what the C is to do."""
        return Drive(self.prepared.station, end)

    @cached_property
    def project(self):
        """The C, not compiled."""
        drive = self.make_drive(ControllerEndpoint(DrakeLcm("memq://"), self.dialect))
        return write_native(self.scenario, self.prepared, drive, self.dialect, self.folder)

    @cached_property
    def program(self):
        """The loop, compiled."""
        self.project.compile(quiet, "-O0")
        return self.project.program

    def statuses(self, duration):
        """Return what the robot tells while it is driven in lockstep, and what its sensor does."""
        settings = load_typed(Scenario, self.scenario.data, "")
        settings.simulation.integrator, settings.simulation.max_step = "runge_kutta3", 1e-3
        lcm = DrakeLcm("memq://")
        robot_end, end = RobotEndpoint(lcm, self.dialect), ControllerEndpoint(lcm, self.dialect)
        station = build_robot_station(settings, self.scenario.path.parent)
        options = DriverOptions(low_pass=0.0)
        way = Transport(delay=1 if settings.driver.delay else 0)
        robot = SimulatedRobot(station, settings, robot_end, options, way)
        drive, told = self.make_drive(end), []
        while len(told) < duration / robot.period:
            robot.tell()
            told.append((end.receive(0.0), np.zeros(6) if end.wrench is None else end.wrench))
            if len(told) == 1:
                drive.begin(told[0][0])
            drive.answer(told[-1][0])
            robot.advance()
        assert drive.result(1.0).fault is None
        return told

    def rows(self, told, events=None, overrides=None):
        """Return statuses as a record that nobody has answered; what changes, from which on."""
        form = self.project.record
        rows = np.zeros(len(told), form.row)
        rows["override"] = 1.0
        for row, (status, wrench) in zip(rows, told, strict=True):
            data = np.frombuffer(self.dialect.encode_status(status), np.uint8)
            row["size"], row["wrench"] = len(data), wrench
            row["message"][: len(data)] = data
        for k, event in (events or {}).items():
            rows["event"][k:] = event
        for k, override in (overrides or {}).items():
            rows["override"][k:] = override
        return rows

    def answer(self, rows, program=None):
        """Return what the loop in C makes of a record, and what its description does."""
        form = self.project.record
        form.write(self.folder / "told.bin", rows)
        command = [program or self.program, "-r", "told.bin", "100", "answered.bin"]
        said = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, check=True)
        run = NativeRun(
            form.read(self.folder / "answered.bin"), said.stdout.strip().removeprefix("end ")
        )
        return run, RepeatedDrive(run, self.make_drive, self.dialect, quiet)


def changed(told, begin, change, end=None):
    """Return statuses of which some are changed: by the status and the number of its tick."""
    chosen = range(begin, len(told) if end is None else end)
    return [
        (replace(status, **change(status)) if k in chosen else status, wrench)
        for k, (status, wrench) in enumerate(told)
    ]
