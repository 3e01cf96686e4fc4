"""Messages stay readable whatever is in them."""

from pfsc_drake.errors import MAX_MESSAGE, InputError, shortened


def test_a_message_with_a_huge_value_keeps_what_stands_around_it():
    message = str(InputError(f"points.csv, line 3, column x: '{'9' * 50_000_000}' is no number"))
    assert len(message) == MAX_MESSAGE
    assert message.startswith("points.csv, line 3, column x: '999")
    assert message.endswith("999' is no number")


def test_short_texts_stay_as_they_are():
    assert shortened("a" * 60) == "a" * 60
    assert shortened("a" * 40 + "b" * 21) == "a" * 38 + "..." + "b" * 19
    assert str(InputError("x" * MAX_MESSAGE)) == "x" * MAX_MESSAGE
