"""Arguments that several commands share, so that they read and behave alike."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

Output = Annotated[Path, tyro.conf.arg(name="output", aliases=["-o"])]
OptionalOutput = Annotated[Path | None, tyro.conf.arg(name="output", aliases=["-o"])]
