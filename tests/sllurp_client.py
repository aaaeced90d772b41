"""An independent LLRP client (of another project), to judge the emulated reader."""

from __future__ import annotations

import asyncio
import threading


async def sllurp_reads(port: int, different: int = 1, **settings: object) -> set[tuple[str, int]]:
    """Set the reader up and listen until so many different (EPC, antenna) are read."""
    import sllurp.llrp as sllurp

    got: set[tuple[str, int]] = set()
    enough = threading.Event()

    def report(client, tags):
        got.update((tag["EPC-96"].decode().upper(), tag["AntennaID"]) for tag in tags)
        if len(got) >= different:
            enough.set()

    config = sllurp.LLRPReaderConfig({"keepalive_interval": 200, **settings})
    client = sllurp.LLRPReaderClient("127.0.0.1", port, config)
    client.add_tag_report_callback(report)
    try:
        await asyncio.to_thread(client.connect)
        assert await asyncio.to_thread(enough.wait, 10)
    finally:
        await asyncio.to_thread(client.disconnect)
        await asyncio.to_thread(client.join, 5)
        client.hard_disconnect()  # where the reader hangs up first, it leaves its socket open
    return got
