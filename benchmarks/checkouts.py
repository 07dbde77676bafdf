"""A checkout whose commands are measured, and the environment of its processes."""

import os
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Checkout:
    """A checkout and where its processes keep their caches."""

    folder: Path
    scratch: Path

    @classmethod
    def of(cls, folder: Path, scratch: Path) -> "Checkout":
        """A checkout without what an earlier call left in its cache: other code computed it."""
        shutil.rmtree(scratch / "cache", ignore_errors=True)
        return cls(folder.resolve(), scratch)

    @property
    def python(self) -> Path:
        """The Python of its `.venv`, or this one."""
        own = self.folder / ".venv" / "bin" / "python"
        return own if own.exists() else Path(sys.executable)

    @property
    def environment(self) -> dict[str, str]:
        """Variables of its processes: its own code and caches, one thread."""
        paths = [self.folder]
        if (self.folder / "models" / "noiseclassifier").is_dir():  # from 0.7 on
            paths.append(self.folder / "models")
        return os.environ | {
            "PYTHONPATH": os.pathsep.join(map(str, paths)),
            "PYTHONPYCACHEPREFIX": str(self.scratch / "bytecode"),
            "PYTHONDONTWRITEBYTECODE": "",
            "XDG_CACHE_HOME": str(self.scratch / "cache"),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
