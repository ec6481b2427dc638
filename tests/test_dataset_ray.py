"""The same crew on a Ray cluster: the same bytes, and a lost actor costs its shard alone."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("ray")

from fsid.dataset import GenerateConfig, Workforce, generate
from fsid.dataset.crew import Ready
from fsid.dataset.ray_crew import _identity, _lacking, _Member, _reason
from fsid.errors import FsidError


def parents(pid: int) -> list[int]:
    chain = []
    while pid > 1:
        stat = Path(f"/proc/{pid}/stat").read_text()
        pid = int(stat.rpartition(")")[2].split()[1])
        chain.append(pid)
    return chain


def actors() -> list[int]:
    """Process ids of the Ray actors that this process started and that are at work."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            at_work = b"ray::_Member.do" in (path / "cmdline").read_bytes()
            if at_work and os.getpid() in parents(int(path.name)):
                found.append(int(path.name))
        except OSError:
            continue
    return found


def kill_two(out: Path, killed: list[int], over: threading.Event) -> None:
    while len(killed) < 2 and not over.wait(0.02):
        fresh = [pid for pid in actors() if pid not in killed]
        if list(out.glob("shard-*.tar")) and fresh:
            os.kill(fresh[0], signal.SIGKILL)
            killed.append(fresh[0])


@pytest.mark.filterwarnings("ignore")  # Ray's own
def test_lost_actors_change_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    for i in range(3):
        Image.fromarray(rng.integers(0, 255, (400, 400, 3), np.uint8)).save(tmp_path / f"{i}.png")
    config = GenerateConfig(images=str(tmp_path), width=384, height=384)
    calm, out = tmp_path / "calm", tmp_path / "out"
    generate(calm, config, count=48, shard_size=4)
    killed: list[int] = []
    lines: list[str] = []
    over = threading.Event()
    killer = threading.Thread(target=kill_two, args=(out, killed, over), daemon=True)
    killer.start()
    force = Workforce(workers=2, ray="local")
    assert generate(out, config, count=48, shard_size=4, workforce=force, lost=lines.append) == 48
    over.set()
    killer.join()
    assert len(killed) == len(lines) == 2
    assert {p.name: p.read_bytes() for p in out.glob("*.tar")} == {
        p.name: p.read_bytes() for p in calm.glob("*.tar")
    }
    assert not list(out.glob(".*.part"))


def test_sigterm_leaves_nothing_half_written(photos: Path, tmp_path: Path) -> None:
    """As without Ray, which has handlers of its own for it."""
    command = [sys.executable, "-m", "fsid", "generate", str(tmp_path), "--count", "4000", "--ray", "local"]
    settings = ["--images", str(photos), "--quiet", "--set", "width=32", "height=32", "noise_levels=1000"]
    process = subprocess.Popen([*command, *settings], stderr=subprocess.PIPE, text=True)
    while not list(tmp_path.glob(".shard-*.part")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    told = process.communicate()[1]
    assert process.returncode == 143
    assert told.split("fsid: ")[1] == "terminated; the same command goes on from what is finished\n"
    assert [path.name for path in tmp_path.iterdir()] == ["config.yaml"]


@pytest.mark.filterwarnings("ignore")
def test_relative_paths_mean_the_same_to_actors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever the cluster was started: there may be folders of the same names."""
    elsewhere, here = tmp_path / "elsewhere", tmp_path / "here"
    for value, folder in enumerate((elsewhere, here)):
        (folder / "pictures").mkdir(parents=True)
        (folder / "out").mkdir()
        Image.new("RGB", (64, 64), (90 + 60 * value, 120, 60)).save(folder / "pictures" / "a.png")
    config = GenerateConfig(images="pictures", width=32, height=32)
    import ray

    monkeypatch.chdir(elsewhere)
    ray.init(address="local", num_cpus=1, log_to_driver=False, logging_level="ERROR")
    try:
        monkeypatch.chdir(here)
        generate("out", config, count=1, workforce=Workforce(ray="local"))
    finally:
        ray.shutdown()
    generate("calm", config, count=1)
    assert not list((elsewhere / "out").iterdir())
    names = ("shard-00000.tar", "config.yaml")
    assert all((here / "out" / name).read_bytes() == (here / "calm" / name).read_bytes() for name in names)


def test_a_machine_without_the_folder_is_one_line(tmp_path: Path) -> None:
    member = _Member(lambda gpu: str, False, str(tmp_path / "gone"))
    result = member.do("task")
    assert isinstance(result, FsidError)
    assert f"cannot work in {tmp_path / 'gone'} (No such file" in str(result)


def test_a_cluster_without_places_for_all_workers_is_one_line() -> None:
    """Ray would wait for ever for a GPU that no machine has."""
    assert _lacking({"CPU": 16.0}, 17, 0) == (
        "--workers 17: the Ray cluster has 16 CPUs, one per worker is needed"
    )
    assert "has 0 GPUs for 4 workers each (--workers-per-gpu)" in _lacking({"CPU": 16.0}, 1, 4)
    assert "has 1 GPU for 4 workers each" in _lacking({"CPU": 16.0, "GPU": 1.0}, 5, 4)
    assert _lacking({"CPU": 16.0, "GPU": 2.0}, 8, 4) == _lacking({"CPU": 16.0}, 16, 0) == ""


def test_bad_input_is_named_with_its_machine(tmp_path: Path) -> None:
    """The one where the command was typed may have the file."""

    def work(task: str) -> None:
        raise FsidError(f"{task}: cannot be opened")

    result = _Member(lambda gpu: work, False, str(tmp_path)).do("a.obj")
    assert str(result) == f"a.obj: cannot be opened (on {socket.gethostname()})"


def test_a_machine_with_another_fsid_is_one_line(tmp_path: Path) -> None:
    """Its pairs would be others, in the same dataset, without a word."""
    member = _Member(lambda gpu: str, False, str(tmp_path))
    assert member.ready(_identity()) == Ready()
    result = member.ready("fsid 0.0.9, files 00000000, NumPy 1.0")
    assert isinstance(result, FsidError)
    assert f"another FSID or NumPy ({_identity()}) than this machine (fsid 0.0.9, files 0" in str(result)


def test_what_was_raised_on_a_machine_is_named_with_it() -> None:
    text = "The actor died because of an error raised in its creation task, A() (pid=1, ip=192.0.2.2)\nE: why"
    assert _reason(RuntimeError(text)) == "RuntimeError on 192.0.2.2: E: why"
    died = "The actor died unexpectedly before finishing this task.\n\tip: 192.0.2.7\nIts process has died."
    assert _reason(RuntimeError(died)) == "RuntimeError on 192.0.2.7"


def test_a_cluster_that_does_not_answer_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(FsidError, match=r"--ray 127\.0\.0\.1:1: no Ray cluster answers there"):
        generate(
            tmp_path, GenerateConfig(width=32, height=32), count=1, workforce=Workforce(ray="127.0.0.1:1")
        )
