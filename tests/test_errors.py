"""Messages stay readable whatever is in them."""

import pytest

from pfsc_drake.errors import (
    MAX_MESSAGE,
    InputError,
    did_you_mean,
    gathered_refusals,
    nearest_file,
    require,
    require_one_of,
    shorten,
    suggestion,
)


def test_a_message_with_a_huge_value_keeps_what_stands_around_it():
    message = str(InputError(f"points.csv, line 3, column x: '{'9' * 50_000_000}' is no number"))
    assert len(message) == MAX_MESSAGE
    assert message.startswith("points.csv, line 3, column x: '999")
    assert message.endswith("999' is no number")


def test_short_texts_stay_as_they_are():
    assert shorten("a" * 60) == "a" * 60
    assert shorten("a" * 40 + "b" * 21) == "a" * 38 + "..." + "b" * 19
    assert str(InputError("x" * MAX_MESSAGE)) == "x" * MAX_MESSAGE


@pytest.mark.parametrize(
    ("word", "hint"),
    [
        ("elatic", "did you mean 'elastic'? "),
        ("ELASTIC", "did you mean 'elastic'? "),
        ("magic", ""),
        ("", ""),
        (3, ""),
        ("e" * 100_000, ""),
    ],
)
def test_the_nearest_word(word, hint):
    assert did_you_mean(word, ["elastic", "rigid"]) == hint
    assert suggestion(word, ["elastic", "rigid"]) == (f"; {hint.rstrip()}" if hint else "")
    assert did_you_mean(word, []) == ""


def test_the_nearest_file(tmp_path):
    (tmp_path / "points.csv").touch()
    (tmp_path / "a\nb.csv").touch()
    assert nearest_file(tmp_path / "point.csv") == "; did you mean 'points.csv'?"
    assert nearest_file(tmp_path / "else.yaml") == ""
    assert nearest_file(tmp_path / "a_b.csv") == ""
    assert nearest_file(tmp_path / "nowhere" / "points.csv") == ""
    assert nearest_file(tmp_path / "a\0b" / "points.csv") == ""


def test_refusals_are_gathered_and_raised_afterwards_again():
    with gathered_refusals() as found:
        require_one_of("law", "rigit", ["rigid"])
        require(False, "law", "rigit", "of one key the first counts")
        require(True, "gain", 1, "anything")
        require(False, "gain", -1, "positive")
        raise InputError("a consequence")
    assert found == [
        "law = rigit; allowed: rigid; did you mean 'rigid'?",
        "gain = -1; allowed: positive",
    ]
    with gathered_refusals() as found:
        raise InputError("on its own")
    assert found == ["on its own"]
    with pytest.raises(InputError):
        require(False, "gain", -1, "positive")
