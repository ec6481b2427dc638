"""fsid demo: the whole chain, small, on a CPU, with a report."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from fsid.cli.arguments import Output
from fsid.cli.progress import progress_bar
from fsid.terminal import Terminal


def demo(
    *,
    output: Output = Path("fsid-demo"),
    scenes: int = 40,
    width: int = 960,
    height: int = 540,
    steps: int = 0,
    photographs: int = 6,
    seed: int = 0,
    quiet: bool = False,
) -> None:
    """Render scenes, train a small network on them alone, measure it on photographs, write a report.

    Writes report.html, results.json and overview.png. Running it again continues it.

    Args:
        output: Folder for everything that is made.
        scenes: Number of rendered scenes to train on.
        width: Width of a scene in pixels.
        height: Height of a scene in pixels.
        steps: Training steps; 0 takes the number of the built-in nafnet-tiny configuration.
        photographs: Number of photographs to measure on, 1 to 6.
        seed: Seed of the scenes.
        quiet: No progress bars.
    """
    from fsid.evaluate.demo import DemoConfig
    from fsid.evaluate.demo import demo as run_demo

    config = DemoConfig(scenes, width, height, steps, photographs, seed)
    report = run_demo(output, config, partial(progress_bar, quiet=quiet))
    Terminal(markup=False).print(f"report: {report.resolve()}", soft_wrap=True)
