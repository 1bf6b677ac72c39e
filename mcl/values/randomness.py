"""Randomness by address: every draw can be repeated on its own from the seed, the step and the purpose."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from enum import IntEnum
from functools import lru_cache
from itertools import permutations
from typing import Any, cast

import numpy as np
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import ArrayLike

from .arrays import F32, U32, U64


class Domain(IntEnum):
    """The part of the program that draws. Simulator and filter never share a stream."""

    FILTER = 1
    SIMULATOR = 2
    IMPORT = 3
    CALIBRATE = 4
    COMPARE = 5


class Purpose(IntEnum):
    """What the filter draws for."""

    INITIALIZATION = 1
    MOTION = 2
    RESAMPLE = 3
    INJECT = 4
    MIXTURE = 5
    ROUGHEN = 6
    OUTLIER = 7
    BRANCH = 8
    GUIDE = 9
    SIZE = 10


BLOCK = 64  # steps whose addresses are made at once: one by one they cost more than most draws


def stream(
    domain: int, seed: int, step: int = 0, purpose: int = 0, child: int | None = None
) -> np.random.Generator:
    """Return the generator at one address; the same address always yields the same numbers.

    It is `numpy.random.default_rng([domain, seed, step, purpose])`, or the numbered child that spawns there.
    Draw per-particle noise row by row: a larger N then keeps the draws of a smaller one.
    Raises ValueError if a part of the address is not in 0 to 2**32 - 1.
    """
    return generator(words_at(domain, seed, step, purpose, child))


def words_at(domain: int, seed: int, step: int, purpose: int, child: int | None = None) -> U64:
    """Return the words (4,) that begin the generator at one address; arguments as for `stream`."""
    block = _block(int(domain), int(seed), int(step) // BLOCK, int(purpose), child)
    words: U64 = block[int(step) % BLOCK]
    return words


def generator(words: U64) -> np.random.Generator:
    """Return the generator that four words (4,) of `address_words` begin."""
    # numpy takes any seed sequence, which its types do not say
    return np.random.Generator(np.random.PCG64(cast(Any, _Known(words))))


@lru_cache(256)
def _block(domain: int, seed: int, block: int, purpose: int, child: int | None) -> U64:
    first = block * BLOCK
    address = [domain, seed, first, purpose, child or 0]
    if any(not 0 <= word < 2**32 for word in address):
        raise ValueError(f"a random address needs whole numbers from 0 to 2**32 - 1, found {address[:4]}")
    words: U64 = address_words(domain, seed, np.arange(first, first + BLOCK), purpose, child)[0]
    return words


POOL = 4  # words that are mixed


def address_words(
    domain: int, seeds: ArrayLike, steps: ArrayLike, purpose: int, child: int | None = None
) -> U64:
    """Return what begins the generators of all seeds (R,) at all steps (U,): words (R, U, 4).

    This is `numpy.random.SeedSequence`, which mixes one address at a time, on arrays (O'Neill 2015).
    """
    others = [purpose] if child is None else [purpose, child]
    parts = [domain, np.reshape(seeds, (-1, 1)), np.reshape(steps, (1, -1)), *others]
    words = [np.atleast_2d(np.asarray(part, np.uint32)) for part in parts]
    multipliers = _multipliers(0x43B0D7E5, 0x931E8875)
    pool = [_hashed(word, multipliers) for word in words[:POOL]]
    for source, into in permutations(range(POOL), 2):
        pool[into] = _mixed(pool[into], _hashed(pool[source], multipliers))
    for word in words[POOL:]:
        pool = [_mixed(part, _hashed(word, multipliers)) for part in pool]
    multipliers = _multipliers(0x8B51F9DD, 0x58F38DED)
    mixed_words = np.stack([_hashed(pool[k % POOL], multipliers) for k in range(2 * POOL)], axis=-1)
    return mixed_words.view(np.uint64)


def _multipliers(first: int, factor: int) -> Iterator[tuple[np.uint32, np.uint32]]:
    while True:
        following = first * factor % 2**32
        yield np.uint32(first), np.uint32(following)
        first = following


def _hashed(word: U32, multipliers: Iterator[tuple[np.uint32, np.uint32]]) -> U32:
    flip, multiply = next(multipliers)
    hashed = (word ^ flip) * multiply
    hashed ^= hashed >> np.uint32(16)
    return hashed


def _mixed(a: U32, b: U32) -> U32:
    mixed = np.uint32(0xCA01F9DD) * a - np.uint32(0x4973F715) * b
    mixed ^= mixed >> np.uint32(16)
    return mixed


class _Known(ISeedSequence):
    """Words for a generator that are already known."""

    def __init__(self, words: U64) -> None:
        self.words = words

    def generate_state(self, n_words: int, dtype: Any = np.uint32) -> U64:
        """Return the four words that `PCG64` asks for."""
        return self.words


ROWS = 8192  # drawn at a time: what they need stays in a core's cache


def normals(rng: np.random.Generator, n: int) -> F32:
    """Draw n rows of three standard normals (n, 3), float32, columns contiguous (Box and Muller 1958).

    Each row takes four 24-bit uniforms. This is twice as fast as the generator's own method, and half of it
    is the generator's bits; no value is beyond 5.8.
    """
    return normals_of(rng.bit_generator.random_raw(2 * n))  # the bits of `rng.integers` over all 64


def normals_at(addresses: Iterable[U64], n: int) -> F32:
    """Return what `normals` draws from generators that some words (4,) begin: n rows of each, in turn."""
    bits = [np.random.PCG64(cast(Any, _Known(words))).random_raw(2 * n) for words in addresses]
    return normals_of(bits[0] if len(bits) == 1 else np.concatenate(bits))


def normals_of(bits: U64) -> F32:
    """Return rows of three standard normals (n, 3) from random bits (2 n,), some thousand rows at a time."""
    words = bits.view(np.uint32).reshape(-1, 4).T
    n = words.shape[1]
    drawn = np.empty((3, n), np.float32)
    whole, uniform = np.empty((4, min(n, ROWS)), np.uint32), np.empty((4, min(n, ROWS)), np.float32)
    for first in range(0, n, ROWS):
        some, room = slice(first, first + ROWS), slice(n - first)
        np.right_shift(words[:, some], np.uint32(8), out=whole[:, room])
        np.copyto(uniform[:, room], whole[:, room].view(np.int32), casting="unsafe")  # below 2**24: exact
        _box_muller(uniform[:, room], drawn[:, some])
    return drawn.T


def _box_muller(uniform: F32, drawn: F32) -> None:
    """Fill columns (3, n) from whole numbers (4, n) below 2**24, which are overwritten."""
    uniform += 1  # never 0, which has no logarithm
    far, angle = uniform[:2], uniform[2:]
    far *= 2**-24
    np.log(far, out=far)
    far *= -2
    np.sqrt(far, out=far)
    angle *= 2 * math.pi * 2**-24
    np.multiply(far[0], np.sin(angle[0]), out=drawn[2])
    np.multiply(far, np.cos(angle, out=angle), out=drawn[:2])
