"""HDF5 files of unknown origin: one line each."""

import h5py
import numpy as np
import pytest

from experiments.results.run_log import RunLog
from identification.estimation.results import load_estimate
from identification.measurement.files import read_record
from pfsc_drake import InputError
from reporting.hdf5_reading import open_hdf5


def test_numbers_are_read_and_groups_left_out(tmp_path):
    path = tmp_path / "log.h5"
    zeros = np.zeros((2_000_000, 2))
    with h5py.File(path, "w") as file:
        file.create_dataset("x", data=np.arange(3))
        file.create_dataset("zeros", data=zeros, compression="gzip", shuffle=True)
        file.create_group("more")
    assert path.stat().st_size < zeros.nbytes / 200
    with open_hdf5(path, "log") as content:
        assert {name: dataset.shape for name, dataset in content.datasets()} == {
            "x": (3,),
            "zeros": (2_000_000, 2),
        }
    with open_hdf5(path, "log") as content:
        content.check()


def external_link(file, folder):
    with h5py.File(folder / "other.h5", "w") as other:
        other["xi"] = np.arange(3.0)
    file["xi"] = h5py.ExternalLink(str(folder / "other.h5"), "xi")


def external_storage(file, folder):
    (folder / "raw").write_bytes(bytes(24))
    file.create_dataset("xi", (3,), "f8", external=[(str(folder / "raw"), 0, 24)])


def virtual(file, folder):
    layout = h5py.VirtualLayout((3,), "f8")
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "xi", (3,))
    file.create_virtual_dataset("xi", layout)


def huge(file, _folder):
    file.create_dataset("xi", (10**9,), "f8", chunks=(10**6,), compression="gzip")


def many_large(file, _folder):
    for name in "abc":
        file.create_dataset(f"xi_{name}", (5 * 10**6,), "f8", chunks=(10**6,))


def endless(file, _folder):
    file.create_dataset("xi", (2**62, 2**62), "f8", chunks=(1, 1))


def words(file, _folder):
    file.create_dataset("xi", data=["a"], dtype=h5py.string_dtype())


def compound(file, _folder):
    file.create_dataset("xi", (3,), np.dtype([("a", "f8"), ("b", "f8")]))


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (external_link, "'xi' is a link"),
        (external_storage, "'xi' is stored in another file"),
        (virtual, "'xi' is stored in another file"),
        (huge, "'xi' takes 8 GB; allowed: 0.1"),
        (many_large, "'xi_c' takes 0.04 GB; allowed: 0.0"),
        (endless, "'xi' takes"),
        (words, "'xi' is of object; allowed: numbers"),
        (compound, "allowed: numbers"),
    ],
)
@pytest.mark.parametrize(
    "read",
    [RunLog.read, load_estimate, lambda path: read_record(str(path), None)],
    ids=["log", "e", "r"],
)
def test_what_is_more_than_numbers_is_one_line(tmp_path, make, reason, read):
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["t"] = np.arange(3.0)
        make(file, tmp_path)
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert reason in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.slow
def test_a_group_that_contains_itself_ends(tmp_path):
    path = tmp_path / "identification.h5"
    with h5py.File(path, "w") as file:
        file["loop"] = file["/"]
    with pytest.raises(InputError, match="more than 10000 names"):
        load_estimate(path)


@pytest.mark.parametrize("labels", [3, [[1.0]], b"\xff"])
def test_labels_of_another_kind_are_one_line(tmp_path, labels):
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["t"] = np.arange(3.0)
        file["xi"] = np.arange(2.0)
        file["xi"].attrs["labels"], file["xi"].attrs["unit"] = labels, "m"
    with pytest.raises(InputError):
        RunLog.read(path)
