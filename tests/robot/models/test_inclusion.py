"""Models that include others, or themselves."""

import os

from pydrake.multibody.parsing import PackageMap

from pfsc_drake.robot.models.files import MOST_INCLUSIONS, read_with_inclusions

INCLUDE = "<include><uri>{}</uri></include>"


def sdf(*uris):
    return f"<sdf><model name='m'>{''.join(map(INCLUDE.format, uris))}</model></sdf>"


def test_a_model_that_includes_itself(write, refused):
    file = write(sdf("arm.sdf"), "arm.sdf")
    refused(lambda: read_with_inclusions(file, PackageMap()), f"{file}:1", "includes itself")
    write(sdf("deep/../one.sdf"), "two.sdf")
    write("", "deep/nothing")
    one = write(sdf("two.sdf"), "one.sdf")
    refused(lambda: read_with_inclusions(one, PackageMap()), "two.sdf:1", "includes itself")
    mjcf = write("<mujoco><include file='self.xml'/></mujoco>", "self.xml")
    refused(lambda: read_with_inclusions(mjcf, PackageMap()), "includes itself")


def test_what_is_included_is_read_once(write, tmp_path):
    leaf = write(sdf(), "packages/tool/tool.sdf")
    write("<model><sdf>old.sdf</sdf><sdf>tool.sdf</sdf></model>", "packages/tool/model.config")
    packages = PackageMap()
    packages.Add("tool", str(leaf.parent))
    uris = "package://tool/tool.sdf", "model://tool", leaf.as_uri(), "package://gone/x.sdf", "x.sdf"
    file = write(sdf(*uris), "arm.sdf")
    assert [m.file for m in read_with_inclusions(file, packages)] == [file, leaf]


def test_inclusions_that_multiply(write, refused):
    """Ten files, each with the next one ten times: 10^10 models."""
    for level in range(10):
        write(sdf(*[f"m{level + 1}.sdf"] * 10), f"m{level}.sdf")
    write(sdf(), "m10.sdf")
    file = write(sdf("m0.sdf"), "arm.sdf")
    refused(lambda: read_with_inclusions(file, PackageMap()), file, MOST_INCLUSIONS)


def test_inclusion_of_a_pipe(write, refused, tmp_path):
    os.mkfifo(tmp_path / "pipe.sdf")
    file = write(sdf("pipe.sdf"), "arm.sdf")
    refused(lambda: read_with_inclusions(file, PackageMap()), "pipe.sdf", "regular file")
