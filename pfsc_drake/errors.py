"""The one error raised for input that cannot be used."""


class InputError(ValueError):
    """Input from outside is wrong; raised where it enters, before anything moves.

    The message is one line that names the thing (file, key, parameter), its
    value and what is allowed.
    """
