"""Feeds every parser of device bytes with seeded random and mutated input, and prints a table.

    python benchmarks/fuzz_devices.py                      one million inputs each, a few minutes
    python benchmarks/fuzz_devices.py --only tr3 --inputs 10000 --seed 7

Checked after every input: no exception but ``DeviceFault`` (which a session may raise and is then begun anew), and no
more bytes held than the parser promises. Checked over a further run: traced memory does not grow. Status 1, with the
seed and the bytes, where anything fails.
"""

from __future__ import annotations

import argparse
import gc
import os
import random
import sys
import time
import tracemalloc
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

from fuzz_targets import TARGETS, Target

from tms_agents.devices.transport import DeviceFault

#: Inputs of the run in which memory is traced, and what it may grow by beside the buffers, in bytes.
_TRACED, _SLACK = 20_000, 256_000


class Failure(Exception):
    """An input that a parser did not stand."""


@dataclass(frozen=True, slots=True)
class Result:
    inputs: int
    megabytes: float
    faults: int
    held: int
    most: int
    growth: int
    seconds: float


def inputs(samples: Sequence[bytes], rng: random.Random) -> Iterator[bytes]:
    """For ever: samples as they are, mutated, cut, joined, and bytes that mean nothing."""
    pick, number, below = rng.choice, rng.random, rng.randrange
    while True:
        kind, sample = number(), pick(samples)
        if kind < 0.2:
            yield sample
        elif kind < 0.6:
            mutated = bytearray(sample)
            for _ in range(below(1, 4)):
                mutated[below(len(mutated))] = below(256)
            yield bytes(mutated)
        elif kind < 0.75:
            yield sample[: below(len(sample) + 1)]
        elif kind < 0.85:
            yield sample[below(len(sample)) :] + pick(samples)
        else:
            yield rng.randbytes(below(1, 40))


def fuzz(name: str, count: int, seed: int) -> Result:
    """Raises: Failure."""
    target, rng = dict(TARGETS)[name](), random.Random(f"{name} {seed}")
    source = inputs(target.samples, rng)
    began = time.perf_counter()
    size = faults = held = 0
    for i in range(count):
        data = next(source)
        size += len(data)
        try:
            target.feed(data)
        except DeviceFault:
            faults += 1
        except Exception as error:
            raise Failure(f"{name}: input {i} of seed {seed}, {data.hex()}: {error!r}") from error
        if (now := target.held()) > held:
            held = now
            if held > target.most:
                raise Failure(f"{name}: {held} bytes held after input {i} of seed {seed}, {target.most} allowed")
    seconds = time.perf_counter() - began
    growth = _growth(target, source, min(_TRACED, count))
    if growth > _SLACK + target.most:
        raise Failure(f"{name}: {growth} bytes more in use after {_TRACED} inputs")
    return Result(count, size / 1e6, faults, held, target.most, growth, seconds)


def _growth(target: Target, source: Iterator[bytes], count: int) -> int:
    """Bytes more in use after ``count`` inputs than after the first tenth of them."""
    tracemalloc.start()
    try:
        before = 0
        for i in range(count):
            if i == count // 10:
                gc.collect()  # empties the interpreter's lists of spare objects, which are no growth
                before = tracemalloc.get_traced_memory()[0]
            try:
                target.feed(next(source))
            except DeviceFault:
                continue
        gc.collect()
        return tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", default="", metavar="TEXT", help="parsers whose name contains this")
    args = parser.parse_args()
    names = [name for name, _ in TARGETS if args.only in name]
    failed = 0
    print("| parser | inputs | MB | faults | most bytes held | allowed | growth, bytes | µs per input |")
    print("|---|---|---|---|---|---|---|---|")
    with ProcessPoolExecutor(max_workers=args.jobs) as pool:
        for name, future in [(name, pool.submit(fuzz, name, args.inputs, args.seed)) for name in names]:
            try:
                r = future.result()
            except Failure as failure:
                failed += 1
                print(f"| {name} | FAILED: {failure} |", flush=True)
                continue
            print(
                f"| {name} | {r.inputs:,} | {r.megabytes:.1f} | {r.faults:,} | {r.held:,} | {r.most:,} | {r.growth:,} "
                f"| {r.seconds / max(r.inputs, 1) * 1e6:.1f} |",
                flush=True,
            )
    return 1 if failed or not names else 0


if __name__ == "__main__":
    sys.exit(main())
