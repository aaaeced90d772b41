"""The HTTP interface, one function per call: arguments in, flow out. Only here are paths and bodies written."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, TypeVar
from urllib.parse import quote

from pydantic import BaseModel

from tms_client.answers import Location
from tms_client.flows import Call, Flow, Retry, as_model, exchange, nothing
from tms_schemas.agents import AgentPage, AgentView
from tms_schemas.belief import AnomaliesAnswer, LabelsAnswer, MoversAnswer, PlacementsAnswer
from tms_schemas.maps import (
    DoorsAnswer,
    DoorState,
    MapDiff,
    MapIn,
    MapObjects,
    MapPage,
    MapVersion,
    TilePage,
    TilesKept,
    TileUpload,
    TownMap,
    VersionIn,
    VersionPage,
)
from tms_schemas.objects import (
    CatalogueImport,
    IntakeRequest,
    IntakeResult,
    ObjectFields,
    ObjectModel,
    ObjectPage,
    ObjectPatch,
    Product,
    ProductIn,
    TownObject,
    UnknownTagPage,
)
from tms_schemas.observation import BatchAccepted, Observation, ObservationBatch
from tms_schemas.rooms import Room, RoomIn, RoomPage

M = TypeVar("M", bound=BaseModel)
#: x0, y0, x1, y1 in metres.
Area = tuple[float, float, float, float]


class Api:
    """Builds the flows; ``retry`` applies to each call."""

    def __init__(self, retry: Retry) -> None:
        self.retry = retry

    # objects

    def get_object(self, tag: str) -> Flow[TownObject]:
        return self._get(TownObject, f"/v1/objects/{_q(tag)}")

    def put_object(self, tag: str, fields: ObjectFields) -> Flow[TownObject]:
        return self._send(TownObject, "PUT", f"/v1/objects/{_q(tag)}", fields)

    def patch_object(self, tag: str, changes: Mapping[str, Any]) -> Flow[TownObject]:
        return self._send(TownObject, "PATCH", f"/v1/objects/{_q(tag)}", ObjectPatch(**changes))

    def delete_object(self, tag: str) -> Flow[None]:
        return exchange(Call(method="DELETE", path=f"/v1/objects/{_q(tag)}"), nothing, self.retry)

    def object_model(self, tag: str) -> Flow[ObjectModel]:
        return self._get(ObjectModel, f"/v1/objects/{_q(tag)}/model")

    def location(self, tag: str, at: datetime | None = None) -> Flow[Location]:
        return self._get(Location, f"/v1/objects/{_q(tag)}/location", at=at)

    def objects(
        self,
        *,
        q: str | None = None,
        room: str | None = None,
        area: Area | None = None,
        category: str | None = None,
        limit: int | None = None,
        cursor: str | None = None,
    ) -> Flow[ObjectPage]:
        where = None if area is None else ",".join(repr(float(side)) for side in area)
        return self._get(
            ObjectPage, "/v1/objects", q=q, room=room, area=where, category=category, limit=limit, cursor=cursor
        )

    def intake(
        self,
        tag: str,
        *,
        jan: str | None = None,
        name: str | None = None,
        room: str | None = None,
        synonyms: Sequence[str] = (),
    ) -> Flow[IntakeResult]:
        body = IntakeRequest(tag=tag, jan=jan, name=name, room=room, synonyms=list(synonyms))
        return self._send(IntakeResult, "POST", "/v1/intake", body)

    def unknown_tags(
        self, room: str | None = None, *, limit: int | None = None, cursor: str | None = None
    ) -> Flow[UnknownTagPage]:
        return self._get(UnknownTagPage, "/v1/unknown-tags", room=room, limit=limit, cursor=cursor)

    # products

    def product(self, jan: str) -> Flow[Product]:
        return self._get(Product, f"/v1/products/{_q(jan)}")

    def put_product(self, jan: str, product: ProductIn) -> Flow[Product]:
        return self._send(Product, "PUT", f"/v1/products/{_q(jan)}", product)

    def import_catalogue(self, csv: str | bytes) -> Flow[CatalogueImport]:
        content = csv.encode() if isinstance(csv, str) else csv
        call = Call(method="POST", path="/v1/catalogue", content=content, content_type="text/csv; charset=utf-8")
        return exchange(call, as_model(CatalogueImport), self.retry)

    # rooms and their belief

    def rooms(self, *, limit: int | None = None, cursor: str | None = None) -> Flow[RoomPage]:
        return self._get(RoomPage, "/v1/rooms", limit=limit, cursor=cursor)

    def room(self, room: str) -> Flow[Room]:
        return self._get(Room, f"/v1/rooms/{_q(room)}")

    def put_room(self, room: str, fields: RoomIn) -> Flow[Room]:
        return self._send(Room, "PUT", f"/v1/rooms/{_q(room)}", fields)

    def placements(self, room: str, at: datetime | None = None) -> Flow[PlacementsAnswer]:
        return self._get(PlacementsAnswer, f"/v1/rooms/{_q(room)}/placements", at=at)

    def labels(self, room: str, at: datetime | None = None) -> Flow[LabelsAnswer]:
        return self._get(LabelsAnswer, f"/v1/rooms/{_q(room)}/labels", at=at)

    def movers(self, room: str, at: datetime | None = None) -> Flow[MoversAnswer]:
        return self._get(MoversAnswer, f"/v1/rooms/{_q(room)}/movers", at=at)

    def anomalies(self, room: str, at: datetime | None = None) -> Flow[AnomaliesAnswer]:
        return self._get(AnomaliesAnswer, f"/v1/rooms/{_q(room)}/anomalies", at=at)

    # maps

    def maps(self, room: str | None = None, *, limit: int | None = None, cursor: str | None = None) -> Flow[MapPage]:
        return self._get(MapPage, "/v1/maps", room=room, limit=limit, cursor=cursor)

    def get_map(self, map: str) -> Flow[TownMap]:
        return self._get(TownMap, f"/v1/maps/{_q(map)}")

    def put_map(self, map: str, fields: MapIn) -> Flow[TownMap]:
        return self._send(TownMap, "PUT", f"/v1/maps/{_q(map)}", fields)

    def delete_map(self, map: str) -> Flow[None]:
        return exchange(Call(method="DELETE", path=f"/v1/maps/{_q(map)}"), nothing, self.retry)

    def map_versions(self, map: str, *, limit: int | None = None, cursor: str | None = None) -> Flow[VersionPage]:
        return self._get(VersionPage, f"/v1/maps/{_q(map)}/versions", limit=limit, cursor=cursor)

    def post_version(self, map: str, version: VersionIn) -> Flow[MapVersion]:
        return self._send(MapVersion, "POST", f"/v1/maps/{_q(map)}/versions", version)

    def post_tiles(self, map: str, tiles: TileUpload) -> Flow[TilesKept]:
        return self._send(TilesKept, "POST", f"/v1/maps/{_q(map)}/tiles", tiles)

    def map_tiles(
        self,
        map: str,
        *,
        since: int = 0,
        version: int | None = None,
        data: bool = True,
        limit: int | None = None,
        cursor: str | None = None,
    ) -> Flow[TilePage]:
        path = f"/v1/maps/{_q(map)}/tiles"
        return self._get(TilePage, path, since=since, version=version, data=data, limit=limit, cursor=cursor)

    def map_objects(self, map: str, version: int | None = None) -> Flow[MapObjects]:
        return self._get(MapObjects, f"/v1/maps/{_q(map)}/objects", version=version)

    def map_diff(
        self, map: str, before: int, after: int | None = None, least_m: float = 0.0, least_rad: float = 0.0
    ) -> Flow[MapDiff]:
        path = f"/v1/maps/{_q(map)}/diff"
        return self._get(MapDiff, path, before=before, after=after, least_m=least_m, least_rad=least_rad)

    def doors(self, room: str, state: DoorState | None = None) -> Flow[DoorsAnswer]:
        return self._get(DoorsAnswer, f"/v1/rooms/{_q(room)}/doors", state=state)

    def map_file(self, map: str, suffix: str, **params: object) -> Flow[bytes]:
        """``suffix`` is what follows the map's id in the path, such as ``.png``."""
        given = {name: _param(value) for name, value in params.items() if value is not None}
        call = Call(method="GET", path=f"/v1/maps/{_q(map)}{suffix}", params=given)
        return exchange(call, lambda response: response.content, self.retry)

    # agents and what they post

    def agents(self, *, limit: int | None = None, cursor: str | None = None) -> Flow[AgentPage]:
        return self._get(AgentPage, "/v1/agents", limit=limit, cursor=cursor)

    def agent(self, agent: str) -> Flow[AgentView]:
        return self._get(AgentView, f"/v1/agents/{_q(agent)}")

    def post(self, batch: ObservationBatch) -> Flow[BatchAccepted]:
        items = ",".join(to_wire(one) for one in batch.observations)
        return self.post_json(_head(batch.agent, batch.room) + items + "]}")

    def post_numbered(self, agent: str, room: str, items: Sequence[tuple[int, str]]) -> Flow[BatchAccepted]:
        """Post stored bodies (JSON objects without ``seq``) under their sequence numbers."""
        numbered = ",".join(f'{{"seq":{seq},{body[1:]}' for seq, body in items)
        return self.post_json(_head(agent, room) + numbered + "]}")

    def post_json(self, body: str) -> Flow[BatchAccepted]:
        call = Call(method="POST", path="/v1/observations", content=body.encode())
        return exchange(call, as_model(BatchAccepted), self.retry)

    def _get(self, model: type[M], path: str, **params: object) -> Flow[M]:
        given = {name: _param(value) for name, value in params.items() if value is not None}
        return exchange(Call(method="GET", path=path, params=given), as_model(model), self.retry)

    def _send(self, model: type[M], method: str, path: str, body: BaseModel) -> Flow[M]:
        content = body.model_dump_json(by_alias=True, exclude_unset=True).encode()
        return exchange(Call(method=method, path=path, content=content), as_model(model), self.retry)


def to_wire(observation: Observation, *, numbered: bool = True) -> str:
    """JSON of an observation. Absent and null stay different: a tag that is null says that a reader read nothing."""
    fields = observation.model_dump(mode="json", by_alias=True, exclude_unset=True)
    body = {"type": observation.type, **fields}
    if not numbered:
        del body["seq"]
    return json.dumps(body, ensure_ascii=False, separators=(",", ":"), allow_nan=False)


def _head(agent: str, room: str) -> str:
    return f'{{"agent":{json.dumps(agent)},"room":{json.dumps(room)},"observations":['


def _param(value: object) -> str:
    return value.astimezone(UTC).isoformat() if isinstance(value, datetime) else str(value)


def _q(part: str) -> str:
    # "." and ".." would be resolved away as path segments
    return quote(part, safe="") if part.strip(".") else part.replace(".", "%2E")
