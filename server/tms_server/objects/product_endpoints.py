"""Products and the catalogue import over HTTP."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from tms_schemas.base import Jan
from tms_schemas.objects import CatalogueImport, Product, ProductIn, ProductPage
from tms_server.auth import Admin, Caller
from tms_server.db.paging import Cursor, Limit
from tms_server.db.session import ReadSession, Session
from tms_server.objects import products
from tms_server.objects.importing import import_catalogue

router = APIRouter(tags=["products"])

Text = Annotated[str | None, Query(max_length=200, pattern=r"^[^\x00]*$", description="words in name, category or JAN")]


@router.get("/products")
async def list_products(
    _: Caller, session: ReadSession, q: Text = None, limit: Limit = 100, cursor: Cursor = None
) -> ProductPage:
    """The catalogue, by JAN."""
    return await products.list_products(session, q=q, cursor=cursor, limit=limit)


@router.get("/products/{jan}")
async def get_product(jan: Jan, _: Caller, session: ReadSession) -> Product:
    """By JAN, EAN, UPC or GTIN: 8, 12, 13 and 14 digits name the same product."""
    return await products.get_product(session, jan)


@router.put("/products/{jan}", responses={201: {"model": Product, "description": "the product is new"}})
async def put_product(
    jan: Jan, body: ProductIn, _: Admin, session: Session, request: Request, response: Response
) -> Product:
    """Add the product or replace what is known of it. A new weight or size counts for all its objects at once."""
    product, created = await products.put_product(session, request.state.clock, jan, body)
    response.status_code = 201 if created else 200
    return product


@router.post(
    "/catalogue",
    openapi_extra={"requestBody": {"required": True, "content": {"text/csv": {"schema": {"type": "string"}}}}},
)
async def post_catalogue(_: Admin, session: Session, request: Request) -> CatalogueImport:
    """Import products from CSV with the columns jan, name, size, weight_g, class, shape.

    UTF-8 or Shift_JIS. Sizes as `0.06x0.06x0.2` in metres, shapes as JSON polygons. An empty cell leaves what is
    stored. Good rows are stored, bad ones named with line and reason.
    """
    return await import_catalogue(session, request.state.clock, await request.body())
