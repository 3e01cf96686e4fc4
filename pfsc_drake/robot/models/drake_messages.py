"""What Drake has to say while it works, as lines of text instead of lines on the terminal."""

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

# where in Drake's own sources a condition failed; of no use to who wrote the input
_IN_DRAKE = re.compile(r"Failure at \S+ in (\w+)\(\): ")


@dataclass(frozen=True)
class DrakeMessages:
    """Messages of Drake's, one line each, each once.

    Attributes:
        warnings: Its warnings.
        errors: What it could not do, though it went on.
    """

    warnings: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


class _Collector(logging.Handler):
    """Keeps the messages of a logger."""

    def __init__(self, messages: DrakeMessages) -> None:
        super().__init__(logging.WARNING)
        self._messages = messages

    def emit(self, record: logging.LogRecord) -> None:
        """See :class:`logging.Handler`."""
        error = record.levelno >= logging.ERROR
        kept = self._messages.errors if error else self._messages.warnings
        message = one_line(record.getMessage())
        if message not in kept:
            kept.append(message)


@contextmanager
def collected_messages() -> Iterator[DrakeMessages]:
    """Collect Drake's warnings and errors instead of printing them.

    Yields:
        Lists that grow.
    """
    messages = DrakeMessages()
    logger = logging.getLogger("drake")
    level, propagate, handlers = logger.level, logger.propagate, logger.handlers[:]
    logger.handlers[:] = [_Collector(messages)]
    logger.propagate = False
    logger.setLevel(logging.WARNING)
    try:
        yield messages
    finally:
        logger.handlers[:] = handlers
        logger.propagate = propagate
        logger.setLevel(level)


def one_line(text: object) -> str:
    """Return a message of Drake's in one line, without places in Drake's sources."""
    return _IN_DRAKE.sub(r"\1(): ", " ".join(str(text).split()))
