"""Pictures of what the estimator makes of recordings of real people, for docs/floor.md.

    python benchmarks/floor_pictures.py                 all recordings of the shared data folder, into docs/floor_tracks
    python benchmarks/floor_pictures.py --only tamu     those whose names begin so

Prints a table: how many people and things each recording has according to the estimator.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path

from floor import SAMPLES

from tms_agents.commands.floor import main as tms_floor

DOCS = Path(__file__).resolve().parents[1] / "docs" / "floor_tracks"
#: Where the number of people was published with the recording.
PUBLISHED = {"tamu_people_1": 1, "tamu_people_4": 1, "tamu_people_5": 2}


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=DOCS, help="folder of the pictures")
    parser.add_argument("--only", default="", metavar="NAME", help="recordings whose names begin so")
    args = parser.parse_args(arguments)
    folder = SAMPLES / "floor" / "real"
    recordings = [one for one in sorted(folder.glob(f"{args.only}*.npz")) if not one.stem.endswith("_annot")]
    if not recordings:
        parser.error(f"no such recordings at {folder} (TMS_SHARED_DATA)")
    args.out.mkdir(parents=True, exist_ok=True)
    print("| recording | seconds | people | published | things |\n| --- | --- | --- | --- | --- |")
    for path in recordings:
        seconds, people, things = picture(path, args.out / f"{path.stem}.png")
        print(f"| {path.stem} | {seconds:.0f} | {people} | {PUBLISHED.get(path.stem, '')} | {things} |", flush=True)


def picture(recording: Path, png: Path) -> tuple[float, int, int]:
    """Seconds, labels of people, labels of things."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "frames.json"
        tms_floor(["replay", str(recording), "--out", str(out), "--png", str(png)])
        frames = json.loads(out.read_text())
    labels = {(one["attr"], one["id"]) for frame in frames for one in frame["labels"]}
    people = sum(kind == "mover" for kind, _ in labels)
    return frames[-1]["t"] - frames[0]["t"], people, len(labels) - people


if __name__ == "__main__":
    main()
