"""Everything that can be set, with values that hold for all logs we know."""

from __future__ import annotations

from dataclasses import dataclass, field

from tms_agents.slam.motion import OdometryNoise


@dataclass(frozen=True, slots=True)
class Settings:
    """Of the particle filter. Lengths in m, angles in rad."""

    particles: int = 30
    #: As many as their spread asks for, from this number to ``particles``; 0: always ``particles``.
    least_particles: int = 0
    resolution: float = 0.05
    seed: int = 0
    #: A scan is processed once the robot has moved or turned so far since the last one.
    step_m: float = 0.5
    step_rad: float = 0.25
    #: At most so many beams are matched, evenly chosen; all go into the map.
    beams: int = 180
    noise: OdometryNoise = field(default_factory=OdometryNoise)
    #: The distance field reaches so far around surfaces; a beam's error, and how many beams are worth one witness.
    reach_m: float = 0.5
    sigma_m: float = 0.1
    temperature: float = 1.0
    weight_temperature: float = 10.0
    spread: float = 0.5
    #: Resample when the effective number is below this share of the particles.
    resample_below: float = 0.5
    #: Matches with a smaller share of beams near surfaces are searched for more widely.
    poor_share: float = 0.85
    #: Whether people who walk by are left out of matching and of the map.
    people: bool = True
    #: Loop closing: a submap every so many metres (or rad turned).
    submap_m: float = 8.0
    submap_rad: float = 6.0
    #: Light: cells of its map, at most so many beams are matched, and how many of them are worth one witness.
    light_m: float = 0.05
    light_beams: int = 360
    light_temperature: float = 1.5
