"""The fuzzer's modules are imported by name: it is run as a folder, `python tests/fuzz`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
