"""What is refused before any parser gets a model."""

import os

import pytest

from pfsc_drake.robot.models.model_xml import LARGEST_FILE, read_model_xml


def test_elements_know_their_location(write):
    text = '<robot>\n <a/><b x="1>2"><a y="&lt;"/>word</b>\n</robot>'
    model = read_model_xml(write(text))
    spans = {e.line: [] for e in model.root.within()}
    for element in model.root.within():
        spans[element.line].append(model.content[element.start : element.end].decode())
    assert spans[2] == ["<a/>", '<b x="1>2"><a y="&lt;"/>word</b>', '<a y="&lt;"/>']
    inner = model.root.first("b", "a")
    assert inner.attributes == {"y": "<"}
    assert model.root.first("b").text == "word"
    assert model.location(inner) == f"{model.file}:2"
    assert model.root.first("a", "b") is None


def test_prefixes_need_not_be_declared(write):
    model = read_model_xml(write("<robot><drake:gear_ratio value='3'/></robot>"))
    assert model.root.first("drake:gear_ratio").attributes == {"value": "3"}


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        (b"<robot>\xff</robot>", ["not UTF-8"]),
        (b"<robot>", ["not XML", "line 1"]),
        (b"<robot/>\x00", ["not XML"]),
        (b"", ["not XML"]),
        (b"<robot><xacro:include filename='x'/></robot>", [":1:", "xacro"]),
        (b"<robot>\n<link name='$(arg prefix)l'/></robot>", [":2:", "xacro"]),
        (b"<robot><a b='${pi}'/></robot>", ["xacro"]),
        (
            b"<robot>\n<a %s/></robot>" % b" ".join(b'a%d="1"' % i for i in range(1001)),
            [":2:", "1001 attributes of one element", "up to 1000"],
        ),
        (b"<a>" * 300 + b"</a>" * 300, ["200 elements"]),
        (b'<!DOCTYPE r [<!ENTITY a "x"><!ENTITY b "&a;&a;">]><r>&b;</r>', ["entity 'a'"]),
        (b'<!DOCTYPE r [<!ENTITY a SYSTEM "/etc/hostname">]><r>&a;</r>', ["entity 'a'"]),
    ],
)
def test_what_is_no_model(write, refused, content, parts):
    file = write(content)
    refused(lambda: read_model_xml(file), file, *parts)


def test_a_driver_may_have_a_language_of_its_own(write):
    text = "<robot><gazebo><plugin>$(find x)</plugin></gazebo></robot>"
    assert read_model_xml(write(text)).root.name == "robot"


def test_only_regular_files(tmp_path, write, refused):
    fifo = tmp_path / "pipe.urdf"
    os.mkfifo(fifo)
    refused(lambda: read_model_xml(fifo), fifo, "regular file")
    refused(lambda: read_model_xml(tmp_path), tmp_path, "regular file")
    gone = tmp_path / "gone.urdf"
    refused(lambda: read_model_xml(gone), gone, "No such file")
    large = write("<robot/>", "large.urdf")
    os.truncate(large, LARGEST_FILE + 1)
    refused(lambda: read_model_xml(large), large, LARGEST_FILE)
