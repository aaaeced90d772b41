"""SICK's own programs talk to ours: its driver measures with our emulator, our session with its test server.

``TMS_SICK_SCAN_XD`` is the folder of its sources (github.com/SICKAG/sick_scan_xd), in whose ``build`` is the library,
made without ROS.
"""

from __future__ import annotations

import asyncio
import json
import os
import socket
import sys
from pathlib import Path

import numpy as np
import pytest
from link_listening import QUICK, until

from tms_agents.devices.cola import MODELS, ColaDevice, ColaSession
from tms_agents.devices.emulation import TcpLine
from tms_agents.devices.scans import Scan
from tms_agents.devices.transport import Link, tcp

SOURCES = Path(os.environ.get("TMS_SICK_SCAN_XD", "/nonexistent"))
LIBRARY = SOURCES / "build" / "libsick_scan_xd_shared_lib.so"
pytestmark = pytest.mark.peer

#: Prints the fifth cloud that the driver delivers. The driver does not always end when it is told to.
CLIENT = """
import json, os, sys, threading
sources, launch, port = sys.argv[1:]
sys.path.insert(0, sources + "/python/api")
import numpy as np
from sick_scan_api import *

clouds, enough = [], threading.Event()

def heard(_, pointer):
    cloud = pointer.contents
    rows = np.ctypeslib.as_array(cloud.data.buffer, (cloud.data.size,)).copy().reshape(-1, cloud.point_step)
    fields = [cloud.fields.buffer[i] for i in range(cloud.fields.size)]
    columns = {f.name.decode(): rows[:, f.offset : f.offset + 4].copy().view(np.float32)[:, 0] for f in fields}
    clouds.append({name: column.tolist() for name, column in columns.items()})
    if len(clouds) == 5:
        enough.set()

library = SickScanApiLoadLibrary([sources + "/build/"], "libsick_scan_xd_shared_lib.so")
handle = SickScanApiCreate(library)
launch = f"{sources}/launch/{launch} hostname:=127.0.0.1 port:={port}"
SickScanApiInitByLaunchfile(library, handle, launch)
callback = SickScanPointCloudMsgCallback(heard)
SickScanApiRegisterPolarPointCloudMsg(library, handle, callback)
enough.wait(60)
print("CLOUD", json.dumps(clouds[-1] if clouds else None), flush=True)
os._exit(0)
"""

#: The test server of SICK listens everywhere; here it shall not.
SERVER = """
import runpy, socket, sys
class Local(socket.socket):
    def bind(self, address):
        super().bind(("127.0.0.1", address[1]))
socket.socket = Local
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


@pytest.mark.skipif(not LIBRARY.exists(), reason="TMS_SICK_SCAN_XD has no build/libsick_scan_xd_shared_lib.so")
@pytest.mark.parametrize(
    ("model", "dialect", "launch", "first_deg", "strong"),
    [
        ("TiM571", "B", "sick_tim_5xx.launch", -135, True),
        ("TiM571", "A", "sick_tim_5xx_ASCII.launch", -135, True),
        ("LMS111", "B", "sick_lms_1xx.launch", -135, False),  # which does not ask for intensities
        ("LMS511", "B", "sick_lms_5xx.launch", -95, True),
    ],
)
async def test_the_driver_of_sick_measures_with_our_scanner(model, dialect, launch, first_deg, strong):
    device = ColaDevice(lambda: seen, model=MODELS[model], dialect=dialect)
    beams = np.arange(device.beams)
    seen = 2.0 + 0.002 * beams, beams % 240.0 + 10
    async with TcpLine(device, tick_s=0.005) as port:
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", CLIENT, str(SOURCES), launch, str(port.port), stdout=asyncio.subprocess.PIPE
        )
        try:
            async with asyncio.timeout(90):
                said, _ = await process.communicate()
        except TimeoutError:
            process.kill()
            raise
    (line,) = [line for line in said.decode(errors="replace").splitlines() if line.startswith("CLOUD ")]
    cloud = {name: np.array(column) for name, column in json.loads(line[6:]).items()}
    np.testing.assert_allclose(cloud["range"], seen[0], atol=0.0011)
    angles = np.rad2deg(cloud["azimuth"])
    # it takes a third of a degree for 0.3333 degrees, as it is told
    assert angles[[0, -1]] == pytest.approx([first_deg, -first_deg], abs=0.05)
    if strong:
        np.testing.assert_array_equal(cloud["intensity"], seen[1])


@pytest.mark.skipif(not SOURCES.exists(), reason="TMS_SICK_SCAN_XD is not set")
async def test_our_session_measures_with_the_test_server_of_sick(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    (nothing := tmp_path / "none.txt").touch()  # it has one scan of its own
    server = SOURCES / "test" / "emulator" / "test_server.py"
    options = [f"--tcp_port={port}", f"--scandata_file={nothing}", "--scandata_frequency=10"]
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", SERVER, str(server), *options, stdout=asyncio.subprocess.DEVNULL
    )
    try:
        link = Link(tcp("127.0.0.1", port), ColaSession, name="floor", retry=QUICK)
        seen = await until(link, lambda seen: sum(isinstance(item, Scan) for item in seen) == 5, timeout_s=60)
    finally:
        process.kill()
        await process.wait()
    scan = seen[-1]
    assert len(scan.ranges) == 1141 and scan.ranges[:4] == pytest.approx([1.305, 1.299, 1.307, 1.299])
    assert scan.intensities[[0, -1]].tolist() == [254, 208]
