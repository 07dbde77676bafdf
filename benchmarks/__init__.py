"""Speed benchmarks (`python -m benchmarks`) and studies of accuracy, a script each."""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before NumPy is there
