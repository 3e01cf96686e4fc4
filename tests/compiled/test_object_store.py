"""The store of machine code: lost, damaged and shared files."""

import os
import threading
from pathlib import Path

import pytest

from pfsc_drake.compiled.native_code import ObjectStore, user_store

CODE = bytes(range(256)) * 10


def test_keeps_what_is_put(tmp_path):
    store = ObjectStore(tmp_path / "a" / "b")
    assert store.get("key") is None
    store.put("key", CODE)
    store.put("other", b"")
    assert store.get("key") == ObjectStore(tmp_path / "a" / "b").get("key") == CODE
    assert store.get("other") == b""


@pytest.mark.parametrize("length", [0, 10, 32, 33, 1000])
def test_half_a_file_is_none(tmp_path, length):
    store = ObjectStore(tmp_path)
    store.put("key", CODE)
    (tmp_path / "key").write_bytes((tmp_path / "key").read_bytes()[:length])
    assert store.get("key") is None
    store.put("key", CODE)
    assert store.get("key") == CODE


def test_the_oldest_are_deleted(tmp_path):
    store = ObjectStore(tmp_path, capacity=10_000)
    for i in range(6):
        store.put(str(i), CODE)
        os.utime(tmp_path / str(i), (i, i))
    assert [store.get(str(i)) is not None for i in range(6)] == [False] * 3 + [True] * 3


def test_a_folder_that_cannot_be_written_keeps_nothing(tmp_path):
    (tmp_path / "file").write_text("")
    store = ObjectStore(tmp_path / "file" / "folder")
    store.put("key", CODE)
    assert store.get("key") is None


def test_a_full_disk_leaves_nothing_behind(tmp_path, monkeypatch):
    def fail(*_args):
        raise OSError("no space left on device")

    monkeypatch.setattr(Path, "replace", fail)
    store = ObjectStore(tmp_path)
    store.put("key", CODE)
    assert list(tmp_path.iterdir()) == []


def test_many_write_at_once(tmp_path):
    found = []

    def work(i):
        store = ObjectStore(tmp_path)
        for _ in range(20):
            store.put("key", CODE)
            found.append(store.get("key"))

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [CODE] * 80
    assert [file.name for file in tmp_path.iterdir()] == ["key"]


@pytest.mark.parametrize("value", ["", "relative/folder"])
def test_the_user_folder(tmp_path, monkeypatch, value):
    monkeypatch.setenv("XDG_CACHE_HOME", value)
    monkeypatch.setenv("HOME", str(tmp_path))
    user_store().put("key", CODE)
    assert (tmp_path / ".cache" / "pfsc_drake" / "machine_code" / "key").exists()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "elsewhere"))
    assert user_store().get("key") is None


def test_a_user_without_a_home_keeps_nothing(monkeypatch):
    def fail():
        raise RuntimeError("could not determine home directory")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", fail)
    user_store().put("key", CODE)
    assert user_store().get("key") is None
