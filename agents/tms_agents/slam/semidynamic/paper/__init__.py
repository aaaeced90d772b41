"""SLAM-SD as the paper has it: a particle filter per tag that was detected, and a grid that is rewritten."""

from tms_agents.slam.semidynamic.paper.following import Followed, follow
from tms_agents.slam.semidynamic.paper.tagfilter import PaperSettings, PoseOf, TagFilter

__all__ = ["Followed", "PaperSettings", "PoseOf", "TagFilter", "follow"]
