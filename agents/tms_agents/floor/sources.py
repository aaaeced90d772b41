"""Sections that say which laser range finder looks over the floor, and how each is opened."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from tms_agents.config import Section
from tms_agents.devices.cola import PASSWORDS, ColaSession
from tms_agents.devices.lms200 import Lms200Session, Unit, serial_line
from tms_agents.devices.scans import Scan
from tms_agents.devices.scip import PORT, ScipLink, ScipSettings, scip_serial
from tms_agents.devices.transport import Link, tcp
from tms_agents.line_config import Line

_Angle = Annotated[float, Field(ge=-math.pi, le=math.pi)]
_Degrees = Annotated[float, Field(ge=-360, le=360)]
_Hash = Annotated[int, Field(ge=0, le=0xFFFFFFFF)]


class ScipLaser(Line):
    """A Hokuyo laser (URG, UTM, UST, UXM): serial or USB (``device``), or network (``host``, port 10940)."""

    kind: Literal["scip"]
    #: Radians in the sensor's frame, 0 is straight ahead, counter-clockwise; none: all that it measures.
    angle_min: _Angle | None = None
    angle_max: _Angle | None = None
    #: Of so many neighbouring beams the nearest echo; so many scans left out between two.
    cluster: Annotated[int, Field(ge=1, le=99)] = 1
    skip: Annotated[int, Field(ge=0, le=9)] = 0
    #: Ranges up to 4 m in fewer bytes, for slow serial lines.
    short: bool = False
    #: Ask for every scan, so that a slow line is never full of old ones.
    polled: bool = False
    #: Have the strength of the echoes sent, too, by a model that tells it: it tells people apart.
    intensity: bool = True

    default_port: ClassVar[int | None] = PORT

    @model_validator(mode="after")
    def _possible(self) -> ScipLaser:
        self._settings()
        return self

    def _settings(self) -> ScipSettings:
        intensity: Literal["auto", "off"] = "auto" if self.intensity and not self.short else "off"
        same = {one.name for one in fields(ScipSettings)} - {"intensity"}
        return ScipSettings(intensity, **self.model_dump(include=same))

    def link(self, silent_after_s: float) -> Link[Scan]:
        opener = self.opener(115_200) if self.device is None else scip_serial(self.device, self.baud)
        return ScipLink(opener, self._settings(), name=f"SCIP laser {self.place}", silent_after_s=silent_after_s)


class LmsLaser(Section):
    """A SICK LMS2xx on a serial line."""

    kind: Literal["lms200"]
    device: str
    baud: Literal[9600, 19200, 38400, 500000] = 38400
    #: Field of view and step in degrees.
    angle_deg: Literal[100, 180] = 180
    resolution_deg: Annotated[float, Field(ge=0.25, le=1)] = 0.5
    #: A model that has one field of view and step, as the fast ones (S14): they are not set.
    fixed: bool = False
    #: Whole scans as they come, the same with the strength of the echoes (fast models), or each when it is asked for.
    output: Literal["stream", "reflectivity", "request"] = "stream"
    #: Written into the memory of the laser where they differ from what is there; none: as it is set up.
    unit: Unit | None = None
    measuring_mode: Annotated[int, Field(ge=0, le=0xFF)] | None = None

    @model_validator(mode="after")
    def _possible(self) -> LmsLaser:
        if self.resolution_deg not in (0.25, 0.5, 1.0):
            raise ValueError(f"resolution_deg is 0.25, 0.5 or 1, not {self.resolution_deg:g}")
        if self.fixed and not self.model_fields_set.isdisjoint(("angle_deg", "resolution_deg")):
            raise ValueError("angle_deg and resolution_deg are not set where they are fixed")
        self._session()
        return self

    @property
    def place(self) -> str:
        return self.device

    def _session(self) -> Lms200Session:
        return Lms200Session(
            output=self.output,
            angle_deg=None if self.fixed else self.angle_deg,
            resolution_deg=None if self.fixed else self.resolution_deg,
            measuring_mode=self.measuring_mode,
            unit=self.unit,
            baud=self.baud,
        )

    def link(self, silent_after_s: float) -> Link[Scan]:
        return Link(
            serial_line(self.device, self.baud),
            self._session,
            name=f"LMS2xx {self.device}",
            silent_after_s=silent_after_s,
        )


class ColaLaser(Section):
    """A SICK TiM, LMS1xx or LMS5xx on the network (ports 2111 and 2112)."""

    kind: Literal["cola"]
    host: str
    port: Annotated[int, Field(ge=1, le=65535)] = 2112
    dialect: Literal["auto", "A", "B"] = "auto"
    #: The device's own angle of straight ahead, degrees.
    forward_deg: _Degrees = 90.0
    #: Set where given, models that can; a pace or a field goes with a resolution.
    frequency_hz: Annotated[float, Field(gt=0, le=200)] | None = None
    resolution_deg: Annotated[float, Field(gt=0, le=10)] | None = None
    #: The part of the view that is sent, from and to, in the device's own angles.
    field_deg: tuple[_Degrees, _Degrees] | None = None
    layer: Annotated[int, Field(ge=-100, le=100)] = 0
    #: Have the strength of the echoes sent, too: it tells people apart. For that the agent logs in; false: the device
    #: stays as it is set up, without login.
    intensity: bool = True
    #: Hashes to log in with, tried in turn; those that devices come with.
    passwords: Annotated[tuple[_Hash, ...], Field(min_length=1, max_length=10)] = PASSWORDS

    @model_validator(mode="after")
    def _possible(self) -> ColaLaser:
        self._session()
        return self

    @property
    def place(self) -> str:
        """Several layers of one device are several lasers."""
        return f"{self.host}:{self.port}" + (f", layer {self.layer}" if self.layer else "")

    def _session(self) -> ColaSession:
        return ColaSession(
            dialect=self.dialect,
            intensities=True if self.intensity else None,
            frequency_hz=self.frequency_hz,
            resolution_deg=self.resolution_deg,
            field_deg=self.field_deg,
            passwords=self.passwords,
            forward_deg=self.forward_deg,
            layer=self.layer,
        )

    def link(self, silent_after_s: float) -> Link[Scan]:
        return Link(
            tcp(self.host, self.port),
            self._session,
            name=f"CoLa laser {self.host}:{self.port}",
            silent_after_s=silent_after_s,
        )


LaserSource = Annotated[ScipLaser | LmsLaser | ColaLaser, Field(discriminator="kind")]
