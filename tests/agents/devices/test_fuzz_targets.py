"""The fuzzer of all parsers: a short run finds nothing, and a parser that fails is named."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[3] / "benchmarks" / "fuzz_devices.py"


@pytest.fixture(scope="module")
def fuzzer():
    sys.path.append(str(SCRIPT.parent))  # for the targets beside it
    spec = importlib.util.spec_from_file_location("fuzz_devices", SCRIPT)
    module = sys.modules["fuzz_devices"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.path.remove(str(SCRIPT.parent))
    del sys.modules["fuzz_devices"]


def test_a_short_run_finds_nothing(fuzzer):
    for name, _ in fuzzer.TARGETS:
        result = fuzzer.fuzz(name, 500, 3)
        assert result.inputs == 500 and result.held <= result.most


def test_every_parser_takes_samples_of_its_own(fuzzer):
    """Samples that are no whole input of their parser would fuzz only its search for a beginning."""
    for name, make in fuzzer.TARGETS:
        whole = 0
        target = make()
        for sample in target.samples:
            try:
                target.feed(sample)
            except fuzzer.DeviceFault:
                continue
            whole += target.held() == 0
        assert whole >= 2, f"{name} is left with a part of almost every sample"


def test_what_fails_is_said_with_the_input(fuzzer):
    def break_at_x(data):
        if b"\xff" in data:
            raise IndexError("off by one")

    def greedy():
        kept = bytearray()
        return fuzzer.Target(kept.extend, lambda: len(kept), 100, [b"sample"])

    fuzzer.TARGETS += [("broken", lambda: fuzzer.Target(break_at_x, lambda: 0, 0, [b"sample"])), ("greedy", greedy)]
    with pytest.raises(fuzzer.Failure, match=r"broken: input \d+ of seed 1, .*ff.*IndexError"):
        fuzzer.fuzz("broken", 10_000, 1)
    with pytest.raises(fuzzer.Failure, match=r"greedy: 1.. bytes held after input .* 100 allowed"):
        fuzzer.fuzz("greedy", 10_000, 1)
