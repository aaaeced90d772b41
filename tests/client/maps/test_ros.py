"""Files of ``map_server``, written here by hand or by its documentation, and files that are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_client import TownError
from tms_client.maps.files import read_folder
from tms_client.maps.ros import read_image, read_map

#: As in the documentation of map_server.
DOCUMENTED = """\
image: testmap.pgm
resolution: 0.1
origin: [0.0, 0.0, 0.0]
occupied_thresh: 0.65
free_thresh: 0.196
negate: 0
"""
NAV2 = """\
# saved by nav2
image: 'testmap.pgm'
mode: trinary
resolution: 0.05   # metres
origin:
  - -1.5
  - 2e0
  - 0
negate: false
occupied_thresh: 0.65
free_thresh: 0.25
"""


def written(folder: Path, description: str, image: bytes) -> Path:
    (folder / "testmap.pgm").write_bytes(image)
    (folder / "map.yaml").write_text(description)
    return folder / "map.yaml"


def pgm(pixels: list[list[int]], full: int = 255) -> bytes:
    head = f"P5\n# made by a robot\n{len(pixels[0])} {len(pixels)}\n{full}\n".encode()
    width = 2 if full > 255 else 1
    return head + b"".join(pixel.to_bytes(width, "big") for row in pixels for pixel in row)


IMAGE = [[0, 254, 205], [205, 88, 90]]
NAN = float("nan")


def test_a_documented_map(tmp_path: Path) -> None:
    grid = read_map(written(tmp_path, DOCUMENTED, pgm(IMAGE)))
    assert (grid.resolution, grid.origin) == (0.1, (0.0, 0.0))
    # 255 - 88 = 167 = 0.6549 over the threshold, 255 - 90 under it; the last row of the image is the lowest
    np.testing.assert_array_equal(grid.occupancy, [[NAN, 1, NAN], [1, 0, NAN]])


def test_a_map_of_nav2(tmp_path: Path) -> None:
    grid = read_map(written(tmp_path, NAV2, pgm(IMAGE)))
    assert (grid.resolution, grid.origin) == (0.05, (-1.5, 2.0))
    np.testing.assert_array_equal(grid.occupancy, [[0, 1, NAN], [1, 0, 0]])


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("mode: raw\n", [[NAN, 0.88, 0.90], [0, NAN, NAN]]),
        ("mode: scale\n", [[NAN, 1, NAN], [1, 0, NAN]]),
        ("negate: 1\n", [[1, NAN, NAN], [0, 1, 1]]),
    ],
)
def test_modes(tmp_path: Path, change: str, expected: list[list[float]]) -> None:
    grid = read_map(written(tmp_path, DOCUMENTED.replace("negate: 0\n", "") + change, pgm(IMAGE)))
    wanted = np.array(expected)
    if "scale" in change:
        for place, p in (((0, 0), 50 / 255), ((0, 2), 165 / 255), ((1, 2), 50 / 255)):
            wanted[place] = (p - 0.196) / (0.65 - 0.196)
    np.testing.assert_allclose(grid.occupancy, wanted, atol=1e-5)


@given(st.integers(1, 8), st.integers(1, 8), st.sampled_from([1, 7, 255, 256, 65535]), st.randoms(), st.booleans())
def test_images_plain_and_raw(
    tmp_path_factory: pytest.TempPathFactory, width: int, height: int, full: int, random: object, plain: bool
) -> None:
    pixels = [[random.randint(0, full) for _ in range(width)] for _ in range(height)]  # type: ignore[attr-defined]
    path = tmp_path_factory.mktemp("pgm") / "x.pgm"
    if plain:
        rows = "\n".join(" ".join(map(str, row)) for row in pixels)
        path.write_text(f"P2 {width} {height} # size\n{full}\n{rows}\n")
    else:
        path.write_bytes(pgm(pixels, full))
    found, most = read_image(path)
    assert most == (65535 if full > 255 else 255)
    np.testing.assert_allclose(found / most, np.array(pixels) / full, atol=0.51 / most)


BAD: list[tuple[str, bytes, str]] = [
    (DOCUMENTED.replace("testmap", "missing"), pgm(IMAGE), "No such file"),
    (DOCUMENTED.replace("resolution: 0.1\n", ""), pgm(IMAGE), "no resolution"),
    (DOCUMENTED.replace("0.1", "fine"), pgm(IMAGE), "fine"),
    (DOCUMENTED.replace("0.1", "-1"), pgm(IMAGE), "positive"),
    (DOCUMENTED.replace("[0.0, 0.0, 0.0]", "[0.0, 0.0]"), pgm(IMAGE), "not enough values"),
    (DOCUMENTED.replace("[0.0, 0.0, 0.0]", "[0.0, 0.0, 0.3]"), pgm(IMAGE), "turned"),
    (DOCUMENTED + "mode: colour\n", pgm(IMAGE), "colour"),
    (DOCUMENTED + "just words\n", pgm(IMAGE), "line 7|line 8"),
    (DOCUMENTED + "mode: raw\n", pgm(IMAGE, 300), "255 grey levels"),
    (DOCUMENTED, b"\x89PNG", "no image"),
    (DOCUMENTED, pgm(IMAGE)[:-1], "not all of it"),
    (DOCUMENTED, b"P5\n100000 100000\n255\n", "no image|too large"),
    (DOCUMENTED, b"P2\n1 1\n255\nx", "no image"),
    (DOCUMENTED, b"P2\n1 1\n255\n256", "no image"),
]


@pytest.mark.parametrize(("description", "image", "says"), BAD)
def test_what_is_no_map_is_said_in_one_line(tmp_path: Path, description: str, image: bytes, says: str) -> None:
    with pytest.raises(TownError, match=says) as error:
        read_map(written(tmp_path, description, image))
    assert "\n" not in str(error.value)


@given(st.binary(max_size=200), st.binary(max_size=200))
def test_any_bytes_are_a_map_or_an_error(
    tmp_path_factory: pytest.TempPathFactory, description: bytes, image: bytes
) -> None:
    folder = tmp_path_factory.mktemp("map")
    (folder / "testmap.pgm").write_bytes(image)
    for text in (description, DOCUMENTED.encode(), DOCUMENTED.encode()[: len(description)] + description):
        (folder / "map.yaml").write_bytes(text)
        try:
            read_map(folder / "map.yaml")
        except TownError:
            continue


def test_a_folder_of_slam_run(tmp_path: Path) -> None:
    written(tmp_path, DOCUMENTED, pgm(IMAGE))
    p = np.array([[0.5, NAN, 0.25], [1, 0, 0.75]], dtype=np.float32)
    np.save(tmp_path / "map.npy", p)
    found = read_folder(tmp_path)
    np.testing.assert_array_equal(found.grid.occupancy, p)
    assert found.intensity is None
    mean = np.array([[NAN, 7, 8], [9, NAN, 1]], dtype=np.float32)
    np.save(tmp_path / "imap.npy", mean)
    layers = read_folder(tmp_path).intensity
    assert layers is not None and layers.count.tolist() == [[0, 1, 1], [1, 0, 1]]
    np.testing.assert_array_equal(layers.mean, mean)
    np.save(tmp_path / "imap.npy", np.stack((mean, mean / 2, np.where(np.isnan(mean), 0, 5))))
    layers = read_folder(tmp_path).intensity
    assert layers is not None and layers.count.tolist() == [[0, 5, 5], [5, 0, 5]]
    np.testing.assert_array_equal(layers.variance, mean / 2)


def test_arrays_that_do_not_fit_are_named(tmp_path: Path) -> None:
    written(tmp_path, DOCUMENTED, pgm(IMAGE))
    for content in (np.zeros((3, 3)), np.array([["a"] * 3] * 2)):
        np.save(tmp_path / "map.npy", content)
        with pytest.raises(TownError, match=r"map\.npy"):
            read_folder(tmp_path)
    (tmp_path / "map.npy").write_bytes(b"nonsense")
    with pytest.raises(TownError, match=r"map\.npy"):
        read_folder(tmp_path)
