"""One attempt at all samples of a frame.

    light (scene or picture) -> views (truth, what is seen) -> crops x exposures -> clean -> noise levels

Every draw has a random stream of its own, addressed by (frame, attempt, what is drawn, which of them).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from fsid import __version__
from fsid.config import to_plain
from fsid.dataset.checks import distance, fingerprint, flaw
from fsid.dataset.config import Checks, GenerateConfig, split_of
from fsid.dataset.pictures import find_pictures, read_picture
from fsid.dataset.tasks import (
    SceneRenderer,
    Views,
    check_task,
    scene_config,
    views_of_light,
    views_of_scene,
)
from fsid.errors import FsidError
from fsid.files import stamp
from fsid.scene import Scene
from fsid.scene import sample as sample_scene
from fsid.sensor import (
    CameraProfile,
    Raw,
    clean_from_linear,
    clean_from_photo,
    exposure_rand,
    level_rand,
    load_profile,
    noisy_from_clean,
)
from fsid.sensor.light import LONGEST_EXPOSURE_S
from fsid.sensor.metadata import exposure_metadata

_SCENE, _CROP, _EXPOSURE, _COLOUR, _NOISE, _TASK, _UNIT = range(7)
_WINDOWS = 3
"""So many windows of a picture are judged as frames of scenes are."""
_NOTHING = 0.99
"""Share of black, or of blown, pixels of an image that shows nothing."""
Window = tuple[int, int, int, int]
"""Left, top, width, height in pixels of the truth."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A pair and its record. `record` is plain data (JSON).

    more: what a task adds, by the name of its file: `degraded`, the noise-free image behind `noisy` where
    that is not `clean`; `noisy1` ..., the further frames of a burst; `flow1` ..., (H, W, 2) float16, pixels
    right and down from each of them to the first.
    """

    key: str
    clean: Raw
    noisy: Raw
    record: dict[str, Any]
    more: dict[str, Raw | np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class Attempt:
    """refused: why the earlier attempts were. scene: where it is known already; else it is drawn.

    FsidError for a negative seed or frame.
    """

    config: GenerateConfig
    seed: int
    frame: int
    refused: tuple[str, ...] = ()
    scene: Scene | None = None

    def __post_init__(self) -> None:
        for key in ("seed", "frame"):
            if getattr(self, key) < 0:
                raise FsidError(f"{key} {getattr(self, key)}: must not be negative")

    def samples(self, renderer: SceneRenderer | None) -> list[Sample] | str:
        """All samples of the frame, or what is wrong with it."""
        source = self._source(renderer)
        views = source.views
        others = (image for image in views.seen if image is not views.truth)
        if not all(np.isfinite(image).all() for image in (views.truth, *others)):
            return "not finite"
        shots = [self._shot(source, number) for number in range(self.config.exposures)]
        samples: list[Sample] = []
        looks: list[str] = []
        for crop in range(self.config.crops):
            window = self._window(views, crop)
            clean = [shot.clean(_cut(views.truth, window)) for shot in shots]
            if wrong := next(filter(None, (flaw(raw, self._checks()) for raw in clean)), None):
                return wrong
            looks.append(fingerprint(clean[0]))
            if not self.config.images and self._is_old(looks):
                return "near-duplicate"
            facts = {"window": list(window), "fingerprint": looks[-1], **views.facts, **source.facts}
            flow = {f"flow{i}": _cut(each, window) for i, each in enumerate(views.flow, 1)}
            for exposure, shot in enumerate(shots):
                inputs = [
                    clean[exposure] if image is views.truth else shot.clean(_cut(image, window, views.scale))
                    for image in views.seen
                ]
                samples += self._pairs((crop, exposure), shot, clean[exposure], inputs, flow, facts)
        return samples

    def drawn_scene(self) -> Scene:
        """The scene that this attempt renders."""
        if self.scene is not None:
            return self.scene
        config = self.config
        seed = int(self._stream(_SCENE).generate_state(1, np.uint64)[0] >> np.uint64(1))
        return sample_scene(
            scene_config(config), seed, width=config.width, height=config.height, variant=config.variant
        )

    def drawn_picture(self) -> tuple[int, Path]:
        """The picture that this attempt takes, and its number in `config.images`."""
        paths = _listed(self.config.images, stamp(Path(self.config.images)))
        number = self.frame % len(paths)
        return number, paths[number]

    def _checks(self) -> Checks:
        """Those of the configuration; a picture with no better window is taken unless it shows nothing."""
        checks = self.config.checks
        if not self.config.images or len(self.refused) < _WINDOWS:
            return checks
        black, blown = (max(share, _NOTHING) for share in (checks.black_share, checks.blown_share))
        return replace(checks, black_share=black, blown_share=blown)

    def _is_old(self, looks: list[str]) -> bool:
        near = self.config.checks.duplicate_bits
        return any(distance(looks[-1], other) <= near for other in looks[:-1])

    def _source(self, renderer: SceneRenderer | None) -> _Source:
        config, rng = self.config, self._rng(_TASK)
        if not config.images:
            if renderer is None:
                raise FsidError("a renderer is needed to make samples from scenes: that of rendering(config)")
            scene = self.drawn_scene()
            facts = {"split": split_of(config, self.frame), "scene": to_plain(scene)}
            views, shutter_s = views_of_scene(rng, config, scene, renderer), scene.cameras[0].exposure_s
            return _Source(views, facts, is_linear=True, shutter_s=shutter_s)
        number, path = self.drawn_picture()
        check_task(config, [path])
        picture = read_picture(path)
        window = _window_rand(self._rng(_SCENE), picture.pixels, config.width, config.height, step=2)
        facts = {"split": split_of(config, number), "image": path.name}
        return _Source(views_of_light(rng, config, _cut(picture.pixels, window)), facts, picture.is_linear)

    def _shot(self, source: _Source, number: int) -> _Shot:
        rng = self._rng(_EXPOSURE, number)
        profile = load_profile(self.config.cameras[rng.integers(len(self.config.cameras))])
        gains = exposure_rand(rng, source.views.truth) if source.is_linear else None
        return _Shot(profile, gains, source.shutter_s, self._stream(_COLOUR, number))

    def _window(self, views: Views, number: int) -> Window:
        width, height = self.config.crop_width, self.config.crop_height
        rng = self._rng(_CROP, number)
        return _window_rand(rng, views.truth, width or None, height or None, step=2 * views.scale)

    def _pairs(
        self,
        place: tuple[int, int],
        shot: _Shot,
        clean: Raw,
        inputs: list[Raw],
        flow: dict[str, np.ndarray],
        facts: dict[str, Any],
    ) -> Iterator[Sample]:
        """One sample per noise level of a crop and exposure."""
        config, profile = self.config, shot.profile
        crop, exposure = place
        specimen = self._specimen(place, shot)
        for number in range(config.noise_levels):
            rng = self._rng(_NOISE, crop, exposure, number)
            iso, level = level_rand(rng, profile, config.iso_range)
            noisy, *others = (
                noisy_from_clean(rng, raw, iso, level, profile.terms, **specimen) for raw in inputs
            )
            index = (
                (self.frame * config.crops + crop) * config.exposures + exposure
            ) * config.noise_levels + number
            record = {
                "key": sample_key(index),
                "fsid_version": __version__,
                "task": config.task,
                "seed": self.seed,
                "index": index,
                "frame": self.frame,
                "refused": list(self.refused),
                "profile": profile.name,
                "camera": profile.camera,
                "cfa": clean.cfa,
                "black_level": noisy.black_level,
                "white_level": noisy.white_level,
                "white_balance": list(clean.white_balance),
                "xyz_to_camera": np.asarray(clean.xyz_to_camera).tolist(),
                "iso": iso,
                "k": list(level.k),
                "sigma2": list(level.sigma2),
                **specimen,
                **facts,
                "settings": to_plain(config),
            }
            more: dict[str, Raw | np.ndarray] = {f"noisy{i}": raw for i, raw in enumerate(others, 1)}
            if inputs[0] is not clean:
                more["degraded"] = inputs[0]
            more |= {name: _half_precision(each) for name, each in flow.items()}
            yield Sample(sample_key(index), clean, noisy, record, more)

    def _specimen(self, place: tuple[int, int], shot: _Shot) -> dict[str, Any]:
        """What the terms of the profile depend on beside the level, as far as it has such terms.

        Each crop is a part of the sensor with patterns of its own. Where the scene has no shutter time, it is
        that of auto-exposure in low light, which takes the longest before it raises the ISO.
        """
        terms = shot.profile.terms
        facts: dict[str, Any] = {}
        if terms.fixed or terms.prnu or terms.defective:
            facts["unit"] = int(self._rng(_UNIT, *place).integers(2**31))
        if terms.dark_current_e_s:
            facts["exposure_s"] = shot.shutter_s or LONGEST_EXPOSURE_S
        return facts

    def _stream(self, *place: int) -> np.random.SeedSequence:
        return np.random.SeedSequence(self.seed, spawn_key=(self.frame, len(self.refused), *place))

    def _rng(self, *place: int) -> np.random.Generator:
        return np.random.default_rng(self._stream(*place))


@lru_cache(maxsize=1)
def _listed(folder: str, stamped: tuple[int, ...]) -> tuple[Path, ...]:
    """`find_pictures` while the folder is as `stamped` says: of 10,000 it takes longer than a small frame."""
    return tuple(find_pictures(folder))


def _half_precision(flow: np.ndarray) -> np.ndarray:
    """float16 of pixels, NaN where they are more than that holds: far beyond any image."""
    with np.errstate(over="ignore"):
        half = flow.astype(np.float16)
    half[np.isinf(half)] = np.nan
    return half


@dataclass(frozen=True)
class _Source:
    """What a frame is made of, a scene or a picture, and where it is from.

    shutter_s: the scene's own shutter time, 0 where it has none.
    """

    views: Views
    facts: dict[str, Any]
    is_linear: bool
    shutter_s: float = 0.0


@dataclass(frozen=True, eq=False)
class _Shot:
    """One exposure of a frame: camera, brightness and colour. gains: (3,), None for photographs.

    shutter_s: of the scene, 0 where it has none; files state no other.
    """

    profile: CameraProfile
    gains: np.ndarray | None
    shutter_s: float
    colour: np.random.SeedSequence

    def clean(self, image: np.ndarray) -> Raw:
        """The RAW of `image` (H, W, 3); the same colour for every image of the shot."""
        rng = np.random.default_rng(self.colour)
        if self.gains is None:
            return clean_from_photo(rng, image, self.profile)
        raw = clean_from_linear(rng, image, self.profile, self.gains)
        return replace(raw, metadata=exposure_metadata(self.shutter_s)) if self.shutter_s else raw


SAMPLE_KEY = re.compile(r"[0-9]{1,18}")
"""What names a sample; Python turns no text of thousands of digits into a number."""


def sample_key(index: int) -> str:
    """The name of sample `index` inside the shards."""
    return f"{index:08d}"


def _window_rand(
    rng: np.random.Generator, image: np.ndarray, width: int | None, height: int | None, step: int
) -> Window:
    """A random window of at most width x height (None: all there is), all its numbers multiples of `step`."""
    rows, columns = image.shape[:2]
    height = min(height or rows, rows) // step * step
    width = min(width or columns, columns) // step * step
    top, left = (int(rng.integers(free // step + 1)) * step for free in (rows - height, columns - width))
    return left, top, width, height


def _cut(image: np.ndarray, window: Window, scale: int = 1) -> np.ndarray:
    left, top, width, height = (value // scale for value in window)
    return image[top : top + height, left : left + width]
