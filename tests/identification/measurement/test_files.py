"""Records come back from files as they were, and files that say too little are refused."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from identification.measurement.columns import Reading
from identification.measurement.files import read_record, write_record
from pfsc_drake.errors import InputError


@pytest.mark.parametrize("suffix", [".csv", ".h5", ".mat"])
def test_a_record_comes_back(tmp_path, record, robot, series, suffix):
    v = series.motion(record.t)[1]
    full = replace(record, v=v, q_motor=record.q + 1e-3)
    write_record(tmp_path / f"run{suffix}", full, robot)
    read = read_record(tmp_path / f"run{suffix}", robot)
    for name in ("t", "q", "tau", "v", "q_motor"):
        np.testing.assert_allclose(getattr(read, name), getattr(full, name), rtol=1e-11, atol=1e-11)
    assert read.a is None
    assert read.period == record.period
    assert read.joint_names == robot.joint_names


def csv(path, record, header, columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")
    return path


HEADER = "t [ms], tau_2 [kN], q_swing [deg], q_2 [mm], tau_1 [Nm]"


def columns(record):
    q, tau = record.q, record.tau
    return [record.t * 1e3, tau[:, 1] / 1e3, np.rad2deg(q[:, 0]), q[:, 1] * 1e3, tau[:, 0]]


def test_columns_in_any_order_and_unit(tmp_path, record, robot):
    read = read_record(csv(tmp_path / "a.csv", record, HEADER, columns(record)), robot, 2.0)
    np.testing.assert_allclose(read.q, record.q, atol=1e-12)
    np.testing.assert_allclose(read.tau, record.tau, atol=1e-12)
    np.testing.assert_allclose(read.t, record.t, atol=1e-12)
    assert read.period == 2.0


@pytest.mark.parametrize(
    ("wrong", "right", "message"),
    [
        ("q_2 [counts]", "q_2 [mm]", r"q_2: unit \[counts\]; allowed: m, mm"),
        ("q_2", "q_2 [mm]", "q_2: no unit is stated"),
        ("q_3 [mm]", "q_2 [mm]", "of joint '3'; crane has the joints 1 to 2: swing, lift"),
        ("q_1 [rad]", "q_2 [mm]", "q_1 twice"),
        ("current [A]", "tau_2 [kN]", "'current' is unknown; allowed: t, q_1"),
        ("v_2 [m/s]", "tau_2 [kN]", r"no tau_2 \(lift\); tau of all 2 joints"),
        ("v_1 [deg/s]", "t [ms]", "no time"),
        ("q_2 [rad]", "q_2 [mm]", r"unit \[rad\]; allowed: m, mm"),
        ("q_2 [mm", "q_2 [mm]", "must be a name and a unit"),
    ],
)
def test_wrong_columns(tmp_path, record, robot, wrong, right, message):
    file = csv(tmp_path / "a.csv", record, HEADER.replace(right, wrong), columns(record))
    with pytest.raises(InputError, match=message):
        read_record(file, robot)


def test_all_wrong_columns_together(tmp_path, record, robot):
    header = HEADER
    for right, wrong in {
        "q_2 [mm]": "q_2",
        "tau_1 [Nm]": "tau_1 [A]",
        "tau_2 [kN]": "ta_2",
    }.items():
        assert right in header
        header = header.replace(right, wrong)
    file = csv(tmp_path / "a.csv", record, header, columns(record))
    with pytest.raises(InputError) as refused:
        read_record(file, robot)
    message = str(refused.value)
    assert message.startswith(f"{file}: 3 things are wrong: (1) ")
    for part in (
        "tau_1: unit [A]; allowed: Nm, mNm, kNm",
        "'ta_2' is unknown; allowed: t, q_1",
        "did you mean 'tau_2'?",
        "q_2: no unit is stated",
    ):
        assert part in message
    assert "\n" not in message


def test_all_missing_columns_together(tmp_path, record, robot):
    selected = [
        i for i, name in enumerate(HEADER.split(", ")) if not name.startswith(("t ", "tau_2"))
    ]
    header = ", ".join(HEADER.split(", ")[i] for i in selected)
    file = csv(tmp_path / "a.csv", record, header, [columns(record)[i] for i in selected])
    with pytest.raises(InputError, match=r"2 things .* no time; .* no tau_2 \(lift\); tau of all"):
        read_record(file, robot)


def test_counts_with_a_scale_and_other_names(tmp_path, record, robot):
    header = "zeit [s], achse1 [counts], lift [m], i1 [A], f2 [N], unused [V]"
    q, tau = record.q, record.tau
    data = [record.t, q[:, 0] * 1e5, q[:, 1], tau[:, 0] / 0.5, tau[:, 1], record.t]
    file = csv(tmp_path / "a.csv", record, header, data)
    names = {"zeit": "t", "achse1": "q_1", "lift": "q_lift", "i1": "tau_1", "f2": "tau_2"}
    reading = Reading(names, scale={"q_1": 1e-5, "tau_swing": 0.5})
    read = read_record(file, robot, reading=reading)
    np.testing.assert_allclose(read.q, record.q, atol=1e-12)
    np.testing.assert_allclose(read.tau, record.tau, atol=1e-12)


def test_unused_options_are_refused(tmp_path, record, robot):
    file = csv(tmp_path / "a.csv", record, HEADER, columns(record))
    with pytest.raises(InputError, match="names of 'gone' given, which the file does not have"):
        read_record(file, robot, reading=Reading(names={"gone": "q_1"}))
    with pytest.raises(InputError, match="units of 'v' given"):
        read_record(file, robot, reading=Reading(units={"v": "rad/s"}))


def test_a_unit_against_the_file(tmp_path, record, robot):
    file = csv(tmp_path / "a.csv", record, HEADER, columns(record))
    with pytest.raises(InputError, match=r"file says \[deg\]; a unit of \[rad\] was given"):
        read_record(file, robot, reading=Reading(units={"q_1": "rad"}))


def test_a_period_against_the_file(tmp_path, record, robot):
    write_record(tmp_path / "a.csv", record, robot)
    with pytest.raises(InputError, match=r"period \[s\] = 2; one of 3 s was given"):
        read_record(tmp_path / "a.csv", robot, period=3.0)


def test_nan_in_a_table(tmp_path, record, robot):
    data = columns(record)
    data[2][7] = np.nan
    with pytest.raises(InputError, match=r"line 9, column q_swing \[deg\]: 'nan'"):
        read_record(csv(tmp_path / "a.csv", record, HEADER, data), robot)


def test_labels_tell_the_order(tmp_path, record, robot):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("t", data=record.t).attrs["unit"] = "s"
        for name, values in (("q_J", record.q), ("tau_d", record.tau)):
            data = file.create_dataset(name, data=values[:, ::-1])
            data.attrs["labels"] = [f"{name}_2", f"{name}_1"]
            data.attrs["unit"] = ["m", "rad"] if name == "q_J" else ["N", "Nm"]
        file.create_dataset("theta", data=record.t).attrs["unit"] = "1"
    reading = Reading(names={"q_J": "q", "tau_d": "tau"})
    read = read_record(tmp_path / "log.h5", robot, 2.0, reading)
    np.testing.assert_array_equal(read.q, record.q)
    np.testing.assert_array_equal(read.tau, record.tau)


def test_too_many_columns(tmp_path, record, robot):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("q", data=np.ones((20, 3))).attrs["unit"] = "rad"
    with pytest.raises(InputError, match="q has 3 columns; crane has the 2 joints swing, lift"):
        read_record(tmp_path / "a.h5", robot)


def test_mat_without_units(tmp_path, record, robot):
    savemat(tmp_path / "a.mat", {"t": record.t, "q": record.q, "tau": record.tau})
    with pytest.raises(InputError) as refused:
        read_record(tmp_path / "a.mat", robot)
    # all that is missing, and one line that says it
    assert "t, q_1, q_2, tau_1, tau_2: no unit is stated" in str(refused.value)
    options = "--unit t=s --unit q_1=rad --unit q_2=m --unit tau_1=Nm --unit tau_2=N"
    assert str(refused.value).endswith(options)
    units = {"t": "s", "q_1": "rad", "q_2": "m", "tau_1": "Nm", "tau_2": "N"}
    read = read_record(tmp_path / "a.mat", robot, 2.0, Reading(units=units))
    np.testing.assert_array_equal(read.tau, record.tau)


@pytest.mark.parametrize("name", ["a.csv", "a.h5", "a.mat"])
def test_what_is_no_such_file(tmp_path, robot, name):
    (tmp_path / name).write_bytes(b"\x00\xff\x00nothing")
    with pytest.raises(InputError, match=name):
        read_record(tmp_path / name, robot)
    with pytest.raises(InputError, match="No such file"):
        read_record(tmp_path / f"gone_{name}", robot)


def test_unknown_suffix(tmp_path, robot):
    with pytest.raises(InputError, match=r"suffix '.xlsx'; allowed: .csv, .h5, .hdf5, .mat"):
        read_record(tmp_path / "a.xlsx", robot)
