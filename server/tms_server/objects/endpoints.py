"""Objects over HTTP; products and intake beside them."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from tms_schemas.base import Probability, RoomId, Tag
from tms_schemas.objects import ObjectFields, ObjectModel, ObjectPage, ObjectPatch, TownObject
from tms_server.auth import Admin, Caller, require_read, require_see
from tms_server.db.paging import Cursor, Limit
from tms_server.db.session import ReadSession, Session
from tms_server.objects import finding, intake_endpoints, product_endpoints, service

objects = APIRouter(tags=["objects"])

Text = Annotated[
    str | None,
    Query(max_length=200, pattern=r"^[^\x00]*$", description="words that must all occur, in any script and case"),
]
Category = Annotated[str | None, Query(max_length=200, pattern=r"^[^\x00]*$", description="exactly this category")]
AreaText = Annotated[
    str | None,
    Query(max_length=200, description="x0,y0,x1,y1 in metres (needs room): objects that are probably inside"),
]
AtLeast = Annotated[Probability, Query(description="with area: least probability of being inside")]


@objects.get("/objects")
async def list_objects(
    caller: Caller,
    session: ReadSession,
    request: Request,
    q: Text = None,
    room: RoomId | None = None,
    category: Category = None,
    area: AreaText = None,
    min_p: AtLeast = 0.5,
    limit: Limit = 100,
    cursor: Cursor = None,
) -> ObjectPage:
    """The objects that the key may see, by tag.

    `q` looks into name, synonyms, category, tag and JAN; width, case and kana script do not matter.
    """
    if room is not None:
        require_see(caller, room)
        if area is not None:  # where things are is the belief, not master data
            require_read(caller, room)
    search = finding.Search(q=q or "", room=room, category=category, area=finding.rectangle(area, room), min_p=min_p)
    return await finding.find_objects(session, request.state.town, caller, search, cursor=cursor, limit=limit)


@objects.get("/objects/{tag}")
async def get_object(tag: Tag, caller: Caller, session: ReadSession) -> TownObject:
    """What is known of the object; size, weight, category and shape are its product's
    where it has none of its own."""
    found = await service.get_object(session, tag)
    require_see(caller, found.room)
    return found


@objects.put("/objects/{tag}", responses={201: {"model": TownObject, "description": "the object is new"}})
async def put_object(
    tag: Tag, body: ObjectFields, _: Admin, session: Session, request: Request, response: Response
) -> TownObject:
    """Register the object or replace what is known of it. The same body again changes nothing."""
    put = await service.put_object(session, request.state.clock, tag, body)
    response.status_code = 201 if put.created else 200
    return put.object


@objects.patch("/objects/{tag}")
async def patch_object(tag: Tag, body: ObjectPatch, _: Admin, session: Session, request: Request) -> TownObject:
    """Change the fields given; null clears one, an absent one stays."""
    return await service.patch_object(session, request.state.clock, tag, body)


@objects.delete("/objects/{tag}", status_code=204)
async def delete_object(tag: Tag, _: Admin, session: Session, request: Request) -> None:
    """Forget the object; its room tracks it no more."""
    await service.delete_object(session, request.state.clock, tag)


@objects.get("/objects/{tag}/model")
async def get_model(tag: Tag, caller: Caller, session: ReadSession) -> ObjectModel:
    """Geometry for mapping: the object's own shape, or its product's; the tag's pose on it is its own."""
    require_see(caller, (await service.get_object(session, tag)).room)
    return await service.get_model(session, tag)


# After the routes: a router takes over those that exist when it includes another.
router = APIRouter()
for part in (objects, product_endpoints.router, intake_endpoints.router):
    router.include_router(part)
