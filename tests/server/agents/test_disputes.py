"""What is told of a name that two agents have, and for how long."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from tms_server.agents.disputes import Disputes

NOW = datetime(2026, 5, 1, 10, tzinfo=UTC)


def test_it_is_told_until_nothing_was_refused_for_a_minute() -> None:
    disputes = Disputes()
    disputes.note("cab", "seq 1 is recorded", NOW)
    assert disputes.of("cab", NOW + timedelta(seconds=59)).endswith("Refused at 10:00:00: seq 1 is recorded")
    disputes.note("cab", "seq 2 is recorded", NOW + timedelta(seconds=50))
    assert "seq 2" in disputes.of("cab", NOW + timedelta(seconds=100))
    assert disputes.of("cab", NOW + timedelta(seconds=111)) == "" == disputes.of("floor", NOW)


def test_a_clock_that_is_set_back_keeps_nobody_in_dispute() -> None:
    disputes = Disputes()
    disputes.note("cab", "seq 1 is recorded", NOW)
    assert disputes.of("cab", NOW - timedelta(hours=1)) == ""
