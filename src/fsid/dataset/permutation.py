"""An order of all patches of an epoch that needs no memory: a keyed permutation of 0 .. length-1.

    (l, r) -> (r, l xor F(r)),  four rounds        F: a hash of (seed, epoch, round, r)

A Feistel network on the next even number of bits is a permutation whatever F is (Luby and Rackoff 1988);
numbers beyond `length` are sent through it again until they come out below it, which keeps it one. So place p
of epoch e is known without the others: a training resumes anywhere, and ranks share an epoch by counting.
"""

from __future__ import annotations

_MASK = (1 << 64) - 1
_ROUNDS = 4


def mixed(*numbers: int) -> int:
    """64 bits that depend on all of `numbers` (SplitMix64; Steele et al. 2014)."""
    state = 0
    for number in numbers:
        state = ((state ^ number) + 0x9E3779B97F4A7C15) & _MASK
        state = ((state ^ state >> 30) * 0xBF58476D1CE4E5B9) & _MASK
        state = ((state ^ state >> 27) * 0x94D049BB133111EB) & _MASK
        state ^= state >> 31
    return state


def shuffled(place: int, length: int, seed: int, epoch: int) -> int:
    """Which of `length` things comes at `place`, 0 <= place < length."""
    half = max(1, (max(length - 1, 1).bit_length() + 1) // 2)
    low = (1 << half) - 1
    key = mixed(seed, epoch)
    while True:
        left, right = place >> half, place & low
        for turn in range(_ROUNDS):
            left, right = right, left ^ mixed(key, turn, right) & low
        place = left << half | right
        if place < length:
            return place
