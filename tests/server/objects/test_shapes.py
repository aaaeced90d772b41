"""Shapes of objects: what a robot that maps asks for by tag."""

from __future__ import annotations

import json
from pathlib import Path

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_schemas.objects import ObjectFields, Shape

DOOR = {"class": "door_large", "polygon": [[0, -0.02], [1, -0.02], [1, 0.02], [0, 0.02]], "parts": []}
LEGS = {
    "class": "chair",
    "polygon": [[0, 0], [0.4, 0], [0.4, 0.4], [0, 0.4]],
    "parts": [[[0, 0], [0.04, 0], [0.04, 0.04]], [[0.3, 0], [0.34, 0], [0.34, 0.04]]],
}
TEA = "4901234567894"


async def test_a_door_has_a_shape_without_being_a_product(town: httpx.AsyncClient) -> None:
    body = {"name": "door", "tracking": "map", "room": "lab", "shape": DOOR, "tag_pose": [0.4, 0.02, 1.57]}
    made = await town.put("/v1/objects/e2d0", json=body)
    assert made.status_code == 201 and made.json()["shape"] == DOOR
    model = (await town.get("/v1/objects/E2D0/model")).json()
    assert model == {"tag": "E2D0", "tag_pose": [0.4, 0.02, 1.57], **DOOR}
    assert (await town.put("/v1/objects/E2D0", json=body)).status_code == 200


async def test_its_own_shape_wins_over_its_products(town: httpx.AsyncClient) -> None:
    await town.put("/v1/objects/E1", json={"name": "tea", "jan": TEA})
    assert (await town.get("/v1/objects/E1/model")).json()["class"] == "bottle"
    changed = await town.patch("/v1/objects/E1", json={"shape": LEGS})
    assert changed.status_code == 200 and changed.json()["shape"] == LEGS
    assert (await town.get("/v1/objects/E1/model")).json()["parts"] == LEGS["parts"]
    # Another change leaves it; to clear it is to have the product's again.
    await town.patch("/v1/objects/E1", json={"name": "green tea"})
    assert (await town.get("/v1/objects/E1/model")).json()["class"] == "chair"
    await town.patch("/v1/objects/E1", json={"shape": None})
    assert (await town.get("/v1/objects/E1/model")).json()["class"] == "bottle"


BAD: list[tuple[object, str]] = [
    (DOOR | {"polygon": [[0, 0], [1, 0], [2, 0]]}, "shape/polygon"),
    (LEGS | {"parts": [LEGS["parts"][0], [[0, 0], [1, 1], [2, 2]]]}, "shape/parts/1"),  # type: ignore[index]
    (DOOR | {"polygon": [[0, 0], [1, 0]]}, "shape"),
    (DOOR | {"polygon": [[0, 0], [1, 0], [0, "high"]]}, "shape"),
    ({"polygon": DOOR["polygon"]}, "shape"),
    (DOOR | {"colour": "red"}, "shape"),
]


async def test_a_shape_that_is_none_is_a_problem(town: httpx.AsyncClient) -> None:
    await town.put("/v1/objects/E1", json={"name": "door"})
    for shape, where in BAD:
        for answer in (
            await town.put("/v1/objects/E1", json={"name": "door", "shape": shape}),
            await town.patch("/v1/objects/E1", json={"shape": shape}),
        ):
            assert answer.status_code == 422
            assert answer.headers["content-type"] == "application/problem+json"
            assert answer.json()["items"][0]["where"].startswith(where)
    assert (await town.get("/v1/objects/E1/model")).status_code == 404


def test_a_models_file_is_read_or_refused_in_one_line(tmp_path: Path) -> None:
    from tms_client.cli import CommandError
    from tms_client.commands.models import _read

    path = tmp_path / "models.json"
    thing = {"class": "chair", "polygon": LEGS["polygon"], "parts": LEGS["parts"], "tag_pose": [0, 0, 0]}
    path.write_text(json.dumps({"robot": {}, "tags": {"e2f00001": thing}}))
    name, shape, pose = _read(path)["E2F00001"]
    assert (name, shape.class_, len(shape.parts), pose) == ("chair 0001", "chair", 2, (0, 0, 0))
    for text in ("", "[]", "{}", '{"tags": {"E1": {"class": "chair"}}}', "[" * 100_000):
        path.write_text(text)
        with pytest.raises(CommandError, match=r"models\.json"):
            _read(path)
    with pytest.raises(CommandError, match="nowhere"):
        _read(tmp_path / "nowhere.json")


corners = st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=3, max_size=8)


@given(corners, st.lists(corners, max_size=4))
def test_shapes_travel_unchanged(polygon: list[tuple[float, float]], parts: list[list[tuple[float, float]]]) -> None:
    shape = Shape.model_validate({"class": "bin", "polygon": polygon, "parts": parts})
    fields = ObjectFields(name="bin", shape=shape)
    assert ObjectFields.model_validate_json(fields.model_dump_json(by_alias=True)) == fields
