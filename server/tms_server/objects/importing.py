"""Import of a catalogue: every row is stored or named with the reason why not."""

from __future__ import annotations

from sqlalchemy.ext.asyncio import AsyncSession

from tms_schemas.objects import CatalogueImport, CatalogueProblem, ProductIn
from tms_server.clock import Clock
from tms_server.db.turns import take_turn
from tms_server.objects.catalogue import Refused, Row, merged, read_catalogue
from tms_server.objects.products import store_products
from tms_server.objects.repository import ProductRepository
from tms_server.objects.views import product_fields


async def import_catalogue(session: AsyncSession, clock: Clock, body: bytes) -> CatalogueImport:
    """Store the good rows. An empty cell leaves what is stored. Raises ``Invalid`` where the file is no catalogue."""
    catalogue = read_catalogue(body)
    rows: list[Row] = []
    refused: list[Refused] = []
    for row in catalogue.rows:
        (rows if isinstance(row, Row) else refused).append(row)  # type: ignore[arg-type]  # sorted by its type
    await take_turn(session)
    known = await ProductRepository(session).many(list({row.jan for row in rows}))
    products: dict[str, ProductIn] = {}
    lines: dict[str, int] = {}
    stored = 0
    for row in rows:
        before = known.get(row.jan)
        try:
            product = merged(row, product_fields(before) if before else None)
            if products.get(row.jan, product) != product:
                raise ValueError(f"jan: {row.jan} is on line {lines[row.jan]} already, with other values")
        except ValueError as error:
            refused.append(Refused(row.line, str(error)))
            continue
        products[row.jan] = product
        lines.setdefault(row.jan, row.line)
        stored += 1
    await store_products(session, clock, products)
    return CatalogueImport(
        stored=stored,
        refused=[CatalogueProblem(line=line, reason=reason) for line, reason in sorted(refused)],
        ignored_columns=catalogue.ignored_columns,
    )
