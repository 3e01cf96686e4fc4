"""Typed dumping: values loaded again are equal, tags included."""

import dataclasses
from dataclasses import dataclass, field

import numpy as np
import pytest

from pfsc_drake.yaml.dumping import changed_data, dump_typed, typed_data
from pfsc_drake.yaml.reading import TAG_KEY, parse_yaml
from pfsc_drake.yaml.typed import load_typed


@dataclass
class Flat:
    """The first member."""

    size: float = 1.0


@dataclass
class Bent:
    """A member with the same key and one more."""

    size: float = 1.0
    coefficient: float = 0.5


@dataclass
class Scene:
    """All kinds of fields."""

    shape: Flat | Bent = field(default_factory=Flat)
    others: list[Flat | Bent] = field(default_factory=list)
    named: dict[str, Bent] = field(default_factory=dict)
    choice: bool | None = True
    limit: float = float("inf")
    text: str = ""
    matrix: np.ndarray = field(default_factory=lambda: np.eye(2))


def _again(scene: Scene) -> Scene:
    return load_typed(Scene, parse_yaml(dump_typed(scene), "dumped"), "dumped")


def test_only_changed_keys_are_left_and_load_as_the_same() -> None:
    assert changed_data(Scene()) == {}
    scene = Scene(Bent(1.0, 3.0), [Flat(), Bent(5.0)], {"a": Bent()}, None, matrix=np.eye(3))
    changed = changed_data(scene)
    assert changed == {
        "shape": {"coefficient": 3.0, TAG_KEY: "!Bent"},
        "others": [{}, {"size": 5.0, TAG_KEY: "!Bent"}],
        "named": {"a": {}},
        "choice": None,
        "matrix": np.eye(3).tolist(),
    }
    assert dump_typed(load_typed(Scene, changed, "changed")) == dump_typed(scene)


def test_mandatory_keys_stay_and_a_default_block_is_the_base() -> None:
    @dataclass
    class Inner:
        number: int = field(default=1, metadata={"required": True})
        size: float = 2.0

    @dataclass
    class Outer:
        inner: Inner = field(default_factory=lambda: Inner(3, 4.0))
        named: dict[str, Inner] = field(default_factory=lambda: {"a": Inner(), "b": Inner()})

    outer = Outer(Inner(3, 2.0), {"a": Inner(), "b": Inner(1, 5.0)})
    changed = changed_data(outer)
    assert changed["inner"] == {"number": 3, "size": 2.0}  # which is not the default here
    assert changed["named"]["b"] == {"number": 1, "size": 5.0}
    assert load_typed(Outer, changed, "changed") == outer


def test_a_later_member_of_a_union_keeps_its_tag_and_its_own_keys() -> None:
    scene = Scene(shape=Bent(2.0, 3.0), others=[Flat(4.0), Bent(5.0, 6.0)])
    assert typed_data(scene)["shape"] == {"size": 2.0, "coefficient": 3.0, TAG_KEY: "!Bent"}
    again = _again(scene)
    assert type(again.shape) is Bent and again.shape == scene.shape
    assert [type(other) for other in again.others] == [Flat, Bent] and again.others == scene.others


def test_null_is_written_where_the_default_is_not_null() -> None:
    assert _again(Scene(choice=None)).choice is None
    assert _again(Scene(choice=False)).choice is False


@pytest.mark.parametrize(
    "text", ["1e-3", "true", "null", "2020-02-31", "#", ": x", "ä", "a\nb", "~"]
)
def test_text_stays_text(text: str) -> None:
    assert _again(Scene(text=text)).text == text


@pytest.mark.parametrize("number", [1e-300, -0.0, 0.1 + 0.2, 1e22, float("-inf"), 3])
def test_numbers_keep_every_bit(number: float) -> None:
    again = _again(Scene(limit=number, matrix=np.array([[number, 1.0]]), named={"a": Bent(number)}))
    assert np.float64(again.limit).tobytes() == np.float64(number).tobytes()
    assert again.matrix.tolist() == [[number, 1.0]] and again.named == {"a": Bent(number)}


def test_numpy_scalars_are_written_as_numbers() -> None:
    assert "limit: 0.25\n" in dump_typed(Scene(limit=np.float64(0.25)))


def test_a_value_of_no_declared_type_is_a_fault_of_the_program() -> None:
    with pytest.raises(TypeError, match="int is none of"):
        dump_typed(Scene(shape=3))  # type: ignore[arg-type]
    other = dataclasses.make_dataclass("Other", [("size", float, 1.0)], bases=(Bent,))
    with pytest.raises(TypeError, match="Other where"):
        dump_typed(Scene(named={"a": other()}))


def test_lists_of_scalars_take_one_line() -> None:
    assert "matrix:\n- [1.0, 0.0]\n- [0.0, 1.0]\n" in dump_typed(Scene())
