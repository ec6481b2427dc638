"""Whatever dies, and whenever: run again, and the set is whole and the same bytes as if nothing had died."""

from __future__ import annotations

import errno
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fsid.config import load_settings
from fsid.dataset import GenerateConfig, generate, shard_keys
from fsid.dataset.crew import TRIES, LocalCrew, Lost, Ready, run
from fsid.errors import FsidError

KILLS = 50
COUNT, SHARD = 96, 4
SCENES = [
    "scene.objects=[1,2]",
    "scene.material_families=[brick,paint]",
    "texture_size=64",
    "supersampling=1",
    "width=64",
    "height=48",
]

SCRIPT = """
import sys
from pathlib import Path
from fsid.config import load_settings
from fsid.dataset import GenerateConfig, generate
out, count, shard, *settings = sys.argv[1:]
config = load_settings(GenerateConfig, None, settings)
generate(Path(out), config, count=int(count), seed=3, workers=2, shard_size=int(shard))
"""


def start(out: Path, count: int, shard: int, settings: list[str]) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", SCRIPT, str(out), str(count), str(shard), *settings]
    return subprocess.Popen(command, stderr=subprocess.PIPE)


def workers_of(parent: int) -> list[int]:
    try:
        children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
        return [int(pid) for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    except (OSError, ValueError):
        return []


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix == ".tar"}


def killed(process: subprocess.Popen[bytes], chance: random.Random, parent_share: float) -> bool:
    """Kill one of the workers, or their parent, at a random moment; False where nothing was there."""
    time.sleep(chance.uniform(0.0, 0.5))
    victims = workers_of(process.pid)
    if process.poll() is not None or not victims:
        return False
    victim = process.pid if chance.random() < parent_share else chance.choice(victims)
    try:
        os.kill(victim, signal.SIGKILL)
    except ProcessLookupError:
        return False
    if victim == process.pid:
        process.wait()
    return True


def disturbed(out: Path, count: int, shard: int, settings: list[str], kills: int, seed: int) -> int:
    """Run until the set is made, killing on the way at most `kills` times; returns how many it were."""
    chance = random.Random(seed)
    done = 0
    process = start(out, count, shard, settings)
    while done < kills:
        done += killed(process, chance, parent_share=0.2)
        if process.poll() is not None:
            message = process.communicate()[1].decode()
            if process.returncode == 0:
                return done
            assert process.returncode == -signal.SIGKILL or "FsidError" in message, message
            process = start(out, count, shard, settings)
    message = process.communicate()[1].decode()
    assert process.returncode == 0 or "FsidError" in message, message
    return done


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Settings of a source that costs next to nothing: small pictures."""
    folder = tmp_path_factory.mktemp("tiny")
    rng = np.random.default_rng(0)
    for i in range(3):
        Image.fromarray(rng.integers(0, 255, (48, 48, 3), np.uint8)).save(folder / f"{i}.png")
    return [f"images={folder}", "width=32", "height=32"]


def finish(out: Path, settings: list[str], count: int, shard: int) -> None:
    generate(out, load_settings(GenerateConfig, None, settings), count=count, seed=3, shard_size=shard)


def check_whole(out: Path, expected: dict[str, bytes], count: int) -> None:
    assert content(out) == expected
    keys = [key for path in sorted(out.glob("shard-*.tar")) for key in shard_keys(path)]
    assert keys == [f"{i:08d}" for i in range(count)]
    assert not list(out.glob("*.part"))


def test_fifty_kills_of_workers_and_parent_change_nothing(tiny: list[str], tmp_path: Path) -> None:
    finish(tmp_path / "calm", tiny, COUNT, SHARD)
    expected = content(tmp_path / "calm")
    kills = run_number = 0
    while kills < KILLS:
        run_number += 1
        out = tmp_path / f"{run_number}"
        kills += disturbed(out, COUNT, SHARD, tiny, KILLS - kills, seed=run_number)
        finish(out, tiny, COUNT, SHARD)
        check_whole(out, expected, COUNT)
    assert kills == KILLS


def test_kills_while_rendering_change_nothing(tmp_path: Path) -> None:
    finish(tmp_path / "calm", SCENES, 6, 2)
    assert disturbed(tmp_path / "out", 6, 2, SCENES, kills=4, seed=1) > 0
    finish(tmp_path / "out", SCENES, 6, 2)
    check_whole(tmp_path / "out", content(tmp_path / "calm"), 6)


def test_what_the_killed_left_half_written_goes_with_the_next_run(tiny: list[str], tmp_path: Path) -> None:
    """Also where nothing else is left to do. What people call nearly so is theirs."""
    theirs = ["README.md.old.part", "shard-1.part"]
    for name in theirs:
        (tmp_path / name).touch()
    left = (".shard-00001.tar.elsewhere-27704.part", "config.yaml.part", "README.md.27704.part")
    for _ in range(2):
        for name in left:
            (tmp_path / name).write_bytes(b"half a")
        finish(tmp_path, tiny, 8, SHARD)
        assert sorted(path.name for path in tmp_path.iterdir() if path.suffix == ".part") == theirs
        assert len(content(tmp_path)) == 2


@pytest.mark.parametrize("workers", ["1", "2"])
def test_sigterm_leaves_nothing_half_written(tiny: list[str], tmp_path: Path, workers: str) -> None:
    """As of Slurm and `docker stop`, which send it to the parent alone."""
    command = ["generate", str(tmp_path), "--count", "2000", "--workers", workers, "--quiet", "--set"]
    settings = [*tiny, "noise_levels=1000"]  # so that a shard takes long
    ended = terminated(command + settings, lambda: list(tmp_path.glob(".shard-*.part")))
    assert ended == (143, "fsid: terminated; the same command goes on from what is finished")
    assert [path.name for path in tmp_path.iterdir()] == ["config.yaml"]


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_signal_takes_a_half_made_test_set_away(tmp_path: Path, number: int, code: int) -> None:
    """SIGHUP: of a terminal that is closed, or a connection that is lost."""
    (tmp_path / "photos").mkdir()
    picture = Image.fromarray(np.random.default_rng(0).integers(0, 255, (512, 512, 3), np.uint8))
    for i in range(40):
        picture.save(tmp_path / "photos" / f"{i}.png")
    command = ["testset", "photos", str(tmp_path / "photos"), "-o", str(tmp_path / "set"), "--quiet"]
    ended = terminated(command, (tmp_path / "set" / ".testset.part").exists, number)
    assert ended == (code, "fsid: terminated")
    assert [path.name for path in tmp_path.iterdir()] == ["photos"]


def test_what_nohup_started_outlives_its_terminal(tiny: list[str], tmp_path: Path) -> None:
    command = [
        "nohup",
        sys.executable,
        "-m",
        "fsid",
        "generate",
        str(tmp_path),
        "--count",
        "96",
        "--seed",
        "3",
    ]
    process = subprocess.Popen(
        [*command, "--set", *tiny], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    while not (tmp_path / "config.yaml").exists():
        assert process.poll() is None
        time.sleep(0.01)
    process.send_signal(signal.SIGHUP)
    assert process.wait() == 0


def terminated(
    arguments: list[str], begun: Callable[[], object], number: int = signal.SIGTERM
) -> tuple[int, str]:
    """Exit code and output of `fsid ARGUMENTS`, sent a signal when it has begun."""
    process = subprocess.Popen(
        [sys.executable, "-m", "fsid", *arguments],
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL),  # nohup around the tests ignores SIGHUP
    )
    while not begun():
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    process.send_signal(number)
    return process.wait(), " ".join(process.communicate()[1].decode().split())


def test_a_run_keeps_others_out_of_its_folder(tiny: list[str], tmp_path: Path) -> None:
    process = start(tmp_path, 2000, SHARD, tiny)
    try:
        while not list(tmp_path.glob("shard-*.tar")):
            assert process.poll() is None
            time.sleep(0.05)
        with pytest.raises(FsidError, match="another fsid generate"):
            finish(tmp_path, tiny, 2000, SHARD)
    finally:
        process.kill()
        process.communicate()


def test_without_locks_a_run_leaves_the_others_their_files(
    tiny: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on some network file systems: another may be at work, but no more after a day."""

    def no_locks(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fsid.files.fcntl.flock", no_locks)
    fresh, old = (tmp_path / f".shard-00001.tar.elsewhere-{pid}.part" for pid in (1, 2))
    for part in (fresh, old):
        part.write_bytes(b"half a")
    os.utime(old, (0, 0))
    finish(tmp_path, tiny, 8, SHARD)
    assert fresh.exists()
    assert not old.exists()
    assert len(content(tmp_path)) == 2


def test_a_full_disk_is_one_line_and_the_next_run_finishes(tiny: list[str], tmp_path: Path) -> None:
    """A limit on the size of files stands for the full disk: writing fails in the middle of a shard."""
    out, soft = tmp_path / "out", resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # Python's own choice, and what makes it an OSError
    resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, soft[1]))
    try:
        with pytest.raises(FsidError, match=r"shard-0000\d\.tar: cannot be written \(File too large\)"):
            finish(out, tiny, 8, SHARD)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, soft)
    assert [path.name for path in out.iterdir()] == ["config.yaml"]
    finish(out, tiny, 8, SHARD)
    finish(tmp_path / "calm", tiny, 8, SHARD)
    check_whole(out, content(tmp_path / "calm"), 8)


def test_a_folder_that_cannot_be_written_is_one_line(tiny: list[str], tmp_path: Path) -> None:
    finish(tmp_path, tiny, 4, SHARD)
    with immutable(tmp_path), pytest.raises(FsidError, match="cannot be written"):
        finish(tmp_path, tiny, 8, SHARD)
    finish(tmp_path, tiny, 8, SHARD)
    assert len(content(tmp_path)) == 2


class immutable:  # noqa: N801  reads as what it does
    """A folder without permission to write; root, whom permissions do not stop, marks it immutable."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __enter__(self) -> None:
        self._folder.chmod(0o555)
        if (
            os.geteuid() == 0
            and subprocess.run(["chattr", "+i", self._folder], capture_output=True).returncode
        ):
            self._folder.chmod(0o755)
            pytest.skip("root, and the file system knows no immutable folders")

    def __exit__(self, *_: object) -> None:
        if os.geteuid() == 0:
            subprocess.run(["chattr", "-i", self._folder], check=True)
        self._folder.chmod(0o755)


def make_deadly(gpu: int | None):  # the work of a worker of the tests below
    return deadly


def deadly(task: str) -> str:
    if task == "poison":
        os.kill(os.getpid(), signal.SIGKILL)
    if task == "bug":
        raise ZeroDivisionError("of the test")
    return task.upper()


def test_a_task_that_kills_its_worker_is_named_after_all_others_are_done() -> None:
    lines: list[str] = []
    done: list[tuple[str, str]] = []
    results = run(LocalCrew(2, make_deadly), ["a", "poison", "b"], tasks_per_worker=1, lost=lines.append)
    with pytest.raises(FsidError, match="poison"):
        done.extend(results)
    assert sorted(done) == [("a", "A"), ("b", "B")]
    assert len(lines) == TRIES
    assert "exit code -9" in lines[0]


def test_a_bug_in_a_worker_keeps_its_traceback() -> None:
    with pytest.raises(RuntimeError, match="ZeroDivisionError: of the test"):
        list(run(LocalCrew(1, make_deadly), ["bug"], tasks_per_worker=10))


def unimportable(gpu: int | None):
    sys.exit(3)


def test_workers_that_cannot_start_end_the_run() -> None:
    with pytest.raises(FsidError, match=r"no worker lives long enough.*through a pipe"):
        list(run(LocalCrew(1, unimportable), ["a", "b"], tasks_per_worker=10))


class Cluster:
    """A crew of two: worker 0 does its tasks, worker 1 never gets a place, or dies as it starts."""

    size = 2

    def __init__(self, second_dies: bool, first_too: bool = False) -> None:
        self._events: list[tuple[int, object]] = []
        self._dying = {1: second_dies, 0: first_too}

    def start(self, worker: int) -> None:
        if self._dying[worker]:
            self._events.append((worker, Lost("no fsid there")))
        elif worker == 0:
            self._events.append((worker, Ready()))

    def send(self, worker: int, task: str) -> None:
        assert worker == 0
        self._events.append((worker, task.upper()))

    def wait(self) -> list[tuple[int, object]]:
        assert self._events, "would wait for ever"
        events, self._events = self._events, []
        return events

    def stop(self) -> None:
        pass


@pytest.mark.parametrize("second_dies", [False, True])
def test_a_worker_that_never_starts_keeps_no_task_from_the_others(second_dies: bool) -> None:
    """As after a cluster has lost a machine, or where one of its machines can start none."""
    tasks, lines = [str(i) for i in range(2 * TRIES + 2)], list[str]()
    results = list(run(Cluster(second_dies), tasks, tasks_per_worker=3, lost=lines.append))
    assert results == [(task, task.upper()) for task in tasks]
    assert set(lines) == ({"worker 1 died (no fsid there) at its start"} if second_dies else set())


def test_a_cluster_on_which_no_worker_starts_ends_the_run() -> None:
    with pytest.raises(FsidError, match=r"no worker lives long .* at its start \(no fsid there\)"):
        list(run(Cluster(True, first_too=True), ["a", "b"], tasks_per_worker=3))


def test_workers_are_replaced_after_some_tasks() -> None:
    pids = [result for _, result in run(LocalCrew(1, make_pid), list(range(4)), tasks_per_worker=2)]
    assert pids[0] == pids[1] != pids[2] == pids[3]


def make_pid(gpu: int | None):
    return lambda task: os.getpid()


def make_environment(gpu: int | None):
    return lambda variable: os.environ[variable]


def test_as_many_workers_as_cores_render_each_in_its_own_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ["LP_NUM_THREADS", "OMP_NUM_THREADS"]
    for name in names:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1, 2, 3})
    for size, expected in ((4, ["0", "1"]), (2, ["2", "2"])):
        found = dict(run(LocalCrew(size, make_environment), names, tasks_per_worker=9))
        assert [found[name] for name in names] == expected


def test_workers_share_gpus_as_configured() -> None:
    gpus = [
        result for _, result in run(LocalCrew(4, make_gpu, workers_per_gpu=2), [0.5] * 4, tasks_per_worker=9)
    ]
    assert sorted(gpus) == [0, 0, 1, 1]


def make_gpu(gpu: int | None):
    def work(task: float) -> int | None:
        time.sleep(task)  # long enough that every worker gets one
        return gpu

    return work
