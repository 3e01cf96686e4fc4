"""Tests; their folders mirror those of the project."""

import os

# before numpy is imported: threads of BLAS compete with the other tests, and wait by spinning
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
