"""A robot that was switched on somewhere finds out where it is, in a map that another robot made.

The demo's robot maps its room before the story. Start the demo in one terminal, and when it says that the map is on
the server, this in another one::

    tms demo
    python examples/localise_in_map.py --url http://127.0.0.1:8080

The drive is simulated here: the same room, other noise of laser and wheels, somewhere on the way, and nobody tells the
robot where. With a recording of your own robot and its map: ``--map corridor --log drive.jsonl``. Needs
``pip install "robot-town-tms[slam,maps]"``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from tms_agents.simulation.survey import recording
from tms_agents.slam import LocalisationSettings, Localiser, Log, known_map, read_log
from tms_agents.slam.geometry import between, compose
from tms_agents.slam.keyframes import key_scans
from tms_agents.slam.logs_recording import parse_recording
from tms_client import Town


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--url", default="http://127.0.0.1:8080")
    parser.add_argument("--key")
    parser.add_argument("--map", default="demo", help="id of the map on the server")
    parser.add_argument("--log", type=Path, help="a recorded drive (default: one simulated in the demo's room)")
    parser.add_argument("--from", type=float, default=0.3, dest="begin", help="share of the drive that is left out")
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    with Town(arguments.url, arguments.key) as town:
        plan = town.map(arguments.map)
    known = known_map(plan.occupancy.astype(float), plan.origin, plan.resolution)
    log = _drive(arguments)
    localiser = Localiser(known, LocalisationSettings(seed=arguments.seed), log.laser)
    keys = [int(n) for n in key_scans(log, 0.25, 0.2) if n >= arguments.begin * len(log)]
    print(f"map {plan.name}, version {plan.version}: the robot may be anywhere on {known.free_m2:.0f} m2")
    localised = False
    for number, n in enumerate(keys):
        estimate = localiser.process(log.odometry[n], log.driven[n], log.points(n))
        best = estimate.best
        driven = log.driven[n, 0] - log.driven[keys[0], 0]
        where = f"x {best.pose[0]:.2f} m, y {best.pose[1]:.2f} m, {np.degrees(best.pose[2]):.0f} deg"
        if estimate.localised != localised:
            localised = estimate.localised
            print(f"after {driven:.1f} m: {'localised at' if localised else 'in doubt, last at'} {where}")
        elif not localised and number % 5 == 0:
            print(f"after {driven:.1f} m: {estimate.particles} particles, the best guess {best.weight:.0%} at {where}")
    if not localised:
        print("the robot does not know where it is")
        return 1
    pose = compose(best.pose, between(log.odometry[keys[-1]], log.odometry[-1]))  # from the last scan on by odometry
    print(f"in the end at x {pose[0]:.2f} m, y {pose[1]:.2f} m in the map, +- {best.spread_m:.2f} m")
    if plan.map_to_room is not None:
        x, y, theta = compose(np.array(plan.map_to_room), pose)
        print(f"in room {plan.room!r} at x {x:.2f} m, y {y:.2f} m, {np.degrees(theta):.0f} deg")
    return 0


def _drive(arguments: argparse.Namespace) -> Log:
    if arguments.log is not None:
        return read_log(arguments.log)
    return parse_recording(recording(np.random.default_rng(arguments.seed)))


if __name__ == "__main__":
    sys.exit(main())
