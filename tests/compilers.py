"""The compiler of the system: without it tests of C are skipped, but not where it is required."""

import os
import shutil

import pytest

GCC_IS_REQUIRED = bool(os.environ.get("PFSC_REQUIRE_GCC"))

needs_gcc = pytest.mark.skipif(
    shutil.which("gcc") is None and not GCC_IS_REQUIRED, reason="there is no gcc"
)
