"""SLAM-SD: localisation, mapping and semi-dynamic objects at once. No I/O to any server."""

from tms_agents.slam.semidynamic.models import Antenna, Models, ObjectModel, parse_models
from tms_agents.slam.semidynamic.paper import PaperSettings, PoseOf
from tms_agents.slam.semidynamic.pipeline import Semidynamic, map_with_objects, robot_path
from tms_agents.slam.semidynamic.reads import Rounds, parse_rounds
from tms_agents.slam.semidynamic.solving import Stay
from tms_agents.slam.semidynamic.visits import Visit

__all__ = [
    "Antenna",
    "Models",
    "ObjectModel",
    "PaperSettings",
    "PoseOf",
    "Rounds",
    "Semidynamic",
    "Stay",
    "Visit",
    "map_with_objects",
    "parse_models",
    "parse_rounds",
    "robot_path",
]
