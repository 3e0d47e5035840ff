"""How well are rooms furnished that people drew, in files of Sweet Home 3D, ProcTHOR or 3D-FRONT? One format a call:

    python experiments/peoples_rooms.py sweethome3d <folder> [--results <folder>]

All that somebody places is taken out and placed anew, as by `place move=all`: by the agents in the package, by the
search, and by both, as `place` does without by=. Rooms in which nothing is taken out do not count. What counts is what
is wrong with the pieces that were taken out, and what they make wrong with those that stay; *as they were drawn* is the
same count where all stood.

Prints the numbers and writes experiments/results/peoples_rooms/<name>.json.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from kept import RESULTS, check_kept, parser_of

from layoutrl.place import furnish
from layoutrl.rooms.faults import FAULTS, Fault, new_faults
from layoutrl.rooms.files import FORMATS, files_below
from layoutrl.rooms.formats import opened
from layoutrl.rooms.oddities import faults_and_oddities
from layoutrl.runs.answer import Answer
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.files import write_json

WHO = {"by the agents alone": "agents", "by the search alone": "search", "by both": None}
KEPT = RESULTS / "peoples_rooms"


def counted(found: Sequence[Sequence[Fault]]) -> dict[str, Any]:
    """Return in how many rooms nothing has a fault, and how many items have each fault or oddity."""
    return {
        "faultless": sum(not any(name in FAULTS for _, name in some) for some in found),
        "wrong": dict(Counter(name for some in found for _, name in some)),
    }


def drawn(answers: Sequence[Answer]) -> list[list[Fault]]:
    """Return what was wrong with the same items where they were drawn, as `place` would report it of a layout."""
    rooms = [answer.request.checked.room for answer in answers]
    stood = [replace(room, furniture=answer.entry.stood) for room, answer in zip(rooms, answers, strict=True)]
    return [
        new_faults(now, was) for now, was in zip(faults_and_oddities(stood), faults_and_oddities(rooms), strict=True)
    ]


def digest(folder: Path) -> str:
    """Return a hash of the content of a folder's files: 12 hex digits."""
    return hashlib.sha256(b"".join(file.read_bytes() for file in files_below(folder, FORMATS))).hexdigest()[:12]


@answers_errors()
def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("name", help="of the file that is written")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--results", type=Path, default=KEPT, help="folder of the file that is written")
    said = parser.parse_args()
    source = opened(said.folder, move="all")
    rooms = source.collection.rooms
    print(source.collection)
    result: dict[str, Any] = {"read": len(rooms), "files": digest(said.folder)}
    check_kept(file := said.results / f"{said.name}.json", result)
    for name, by in WHO.items():
        answers = [answer for answer in furnish(rooms, stood=source.stood, move="all", by=by) if answer.request.wanted]
        result[name] = counted([answer.wrong[0] for answer in answers])
        print(f"{said.name}, {name}: {json.dumps(result[name])}", flush=True)
    result |= {"rooms": len(answers), "items": sum(len(answer.request.wanted) for answer in answers)}
    result["as they were drawn"] = counted(drawn(answers))
    print(f"{said.name}, as they were drawn: {json.dumps(result['as they were drawn'])}", flush=True)
    said.results.mkdir(parents=True, exist_ok=True)
    write_json(file, result)


if __name__ == "__main__":
    main()
