"""Paths of tubes: round ends, tangents, and normals that turn no more than the path does.

    n[k+1] = n[k] - (n[k] . t[k+1]) t[k+1]

A rotation-minimising frame has no twist of its own, so texture runs straight along the tube.
Paths (k, n, 3) and radii (k, n) are in metres.
"""

from __future__ import annotations

import numpy as np

from fsid.assets.surfaces import cross, lengths


def with_caps(paths: np.ndarray, radii: np.ndarray, rings: int) -> tuple[np.ndarray, np.ndarray]:
    """Extend both ends by a quarter circle of `rings` that closes to (nearly) a point."""
    turn = np.linspace(0, np.pi / 2, rings + 1)[1:, None]
    ends = []
    for end, inner, radius in ((0, 1, radii[:, :1]), (-1, -2, radii[:, -1:])):
        outward = paths[:, end] - paths[:, inner]
        outward = (outward / lengths(outward) * radius)[:, None]
        ends.append((paths[:, [end]] + np.sin(turn) * outward, radius * np.maximum(np.cos(turn[:, 0]), 1e-3)))
    (head, head_r), (tail, tail_r) = ends
    return np.hstack([head[:, ::-1], paths, tail]), np.hstack([head_r[:, ::-1], radii, tail_r])


def tangents_of(paths: np.ndarray, closed: bool) -> np.ndarray:
    """(k, n, 3) unit tangents."""
    around = np.roll(paths, -1, axis=1) - np.roll(paths, 1, axis=1)
    step = around if closed else np.gradient(paths, axis=1)
    return step / lengths(step)


def frames_along(tangents: np.ndarray, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Normals and binormals (k, n, 3) of least rotation; a closed path spreads the leftover twist evenly."""
    first = tangents[:, 0]
    normal = np.cross(first, np.eye(3)[np.abs(first).argmin(1)])
    normals = [normal / lengths(normal)]
    for k in [*range(1, tangents.shape[1]), *([0] if closed else [])]:
        tangent, normal = tangents[:, k], normals[-1]
        normals.append(normal - tangent * (tangent * normal).sum(1, keepdims=True))
    transported = np.stack(normals, axis=1)
    transported /= lengths(transported)
    frame = transported[:, : tangents.shape[1]]
    other = cross(tangents, frame)
    if closed:
        last = transported[:, -1]
        leftover = np.arctan2((last * other[:, 0]).sum(1), (last * frame[:, 0]).sum(1))
        angle = (-leftover[:, None] * np.arange(tangents.shape[1]) / tangents.shape[1])[..., None]
        frame, other = (
            frame * np.cos(angle) + other * np.sin(angle),
            other * np.cos(angle) - frame * np.sin(angle),
        )
    return frame, other
