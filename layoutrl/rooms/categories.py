"""Names that other programs give to furniture and rooms, and ours: `categories.yaml`, and a user's own file."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cache, cached_property
from importlib.resources import files
from itertools import chain
from pathlib import Path
from typing import Any

import yaml

from layoutrl import InputError
from layoutrl.rooms.clearances import HOSTS
from layoutrl.rooms.room import MAIN_ITEM

OBSTACLE, DECOR, NO_ROOM = "obstacle", "decor", "no_room"  # keys of the file that are no categories
RUG = "rug"  # a key of the file: floor, on which furniture may stand
NOT_FURNITURE = (DECOR, RUG)  # not read as furniture of a home
NOTED = 20  # unknown names that notes list at most
LARGEST_FILE = 2**20  # bytes of a user's own file
LONGEST = 200  # letters of a name that are read: a file may hold any text, and all ends of a name are tried
SIGNS = re.compile(r"[/&+,;|]|\b(?:and|und|et|y|e)\b", re.IGNORECASE)  # between the names of several rooms in one
# Before what a room or piece also has, or lacks.
WITH = re.compile(r"\b(?:with|without|mit|ohne|avec|sans|con|sin|senza|com|sem|met|zonder|w(?! d\b))\b")
AND = re.compile(r"\b(?:and|und|et|y|e|en)\b")  # between names of furniture, one of which counts
SEATS = {"bench", "chair", "stool"}  # in a name with a desk or table, that one counts instead
# Ends of English plurals, and what singulars have in their place.
PLURALS = (r"ies$", "y"), (r"(ch|sh|ss|x)es$", r"\1"), (r"([^\Ws])s$", r"\1")
UNSPACED = re.compile("[\u3040-\u9fff]")  # characters of languages without spaces between words
FAINT = {  # tell a room's type only where no other word of its name does
    *("ensuite", "en suite", "master", "kids", "guest", "bed", "family", "suite", "deck", "patio", "porch"),
}
BRACKETS = re.compile(r"\(.*?\)|\[.*?\]|\uff08.*?\uff09")  # what is in them does not help to tell what a thing is
SHAPES = {  # words of names of plain shapes, for which another name, given by the user, says more
    *("box", "cylinder", "triangle", "cube", "sphere", "cone", "pyramid", "prism", "shape", "texturable", "half"),
}
SIZE_WORDS = {  # words that may follow an English name, with numbers or without
    *("cm", "mm", "m", "inch", "inches", "ft", "feet", "wide", "high", "deep", "long"),
    *("seats", "seater", "sitzer", "persons", "personen", "people", "places", "plazas", "posti"),
    *("left", "right", "links", "rechts", "gauche", "droite", "round", "rund", "rond", "ronde"),
    *("small", "medium", "large", "big", "xl", "xxl", "king", "queen", "twin", "single", "double", "size", "sized"),
}
ALL = "all"  # value of `move`: everything that can be placed

# TELLING: furniture that tells the type of a room without a name, in this order. DESIGNED: what the designer puts into
# rooms of each type, so that agents and rivals place it there. AS_WELL: what else may be put there.
TELLING = {
    "bathroom": {"toilet", "bathtub", "shower"},
    "bedroom": {"bed"},
    "kitchen": {"cooktop", "fridge", "counter", "sink"},
    "living_room": {"sofa", "loveseat", "tv_unit"},
    "study": {"desk"},
    "dining_room": {"table"},
}
DESIGNED = {
    "balcony": {"laundry_cabinet", "lounge_chair", "plant_rack", "side_table", "sink", "washer"},
    "bathroom": {"bathtub", "shower", "toilet", "vanity", "washing_machine"},
    "bedroom": {"bed", "chair", "desk", "dresser", "nightstand", "tv_unit", "wardrobe"},
    "dining_room": {"bench", "chair", "sideboard", "table"},
    "kitchen": {"cooktop", "counter", "fridge", "sink"},
    "living_room": {"armchair", "bookcase", "coffee_table", "loveseat", "plant_rack", "side_table", "sofa", "tv_unit"},
    "study": {"armchair", "bookcase", "chair", "desk", "side_table", "sofa_bed"},
    "tatami": {"desk", "platform", "stool", "wardrobe"},
}
AS_WELL = {
    "balcony": {"armchair", "bench", "chair", "stool", "table", "washing_machine"},
    "bathroom": {"sink"},
    "bedroom": {"armchair", "bench", "bookcase", "side_table", "stool"},
    "dining_room": {"stool", "wardrobe"},
    "kitchen": {"chair", "sideboard", "stool", "table", "washing_machine"},
    "living_room": {"chair", "lounge_chair", "sideboard", "sofa_bed", "stool", "table"},
    "study": {"lounge_chair", "stool", "wardrobe"},
    "tatami": {"chair"},
}
HOLDS = {room_type: DESIGNED[room_type] | AS_WELL[room_type] for room_type in DESIGNED}


class Names:
    """A lookup of categories and room types by the names of other programs, which counts the unknown names.

    Where several tables have a name, the last one counts.
    """

    def __init__(self, *tables: Mapping[str, Iterable[str]]):
        self._furniture: dict[str, str] = {}
        self._rooms: dict[str, str] = {}
        self._first: set[str] = set()  # names of furniture with a star
        self._winning: set[str] = set()  # names of rooms with a star
        for ours, theirs in chain.from_iterable(table.items() for table in tables):
            rooms = ours in MAIN_ITEM or ours == NO_ROOM
            for name in (ours, *theirs):
                (self._rooms if rooms else self._furniture)[plain(name)] = ours
            starred = {plain(name) for name in theirs if name.endswith("*")}
            (self._winning if rooms else self._first).update(starred)
        order = [*dict.fromkeys(chain(*tables))]
        by_type = sorted(self._rooms.items(), key=lambda entry: (entry[0] in FAINT, order.index(entry[1])))
        self._rooms = dict(by_type)
        self.unknown: Counter[tuple[str, str]] = Counter()  # how often, by (name, its category as an obstacle)

    @cached_property
    def categories(self) -> list[str]:
        """The known categories of furniture, sorted; obstacles, decor and rugs are none."""
        return sorted(set(self._furniture.values()) - {OBSTACLE, *NOT_FURNITURE})

    def category(self, *names: str | None) -> tuple[str, bool] | None:
        """Return (category, whether it is a known one) of a thing with these names; None for decor and rugs.

        An obstacle is called by its name in the table, and an unknown thing by its first name, if any. The latter is
        counted in `unknown`.
        """
        given = [name for name in names if name and name.strip()]
        if part := self._known(given):
            found = self._furniture[part]
            called = part.replace(" ", "_") if found == OBSTACLE else found
            return None if found in NOT_FURNITURE else (called, found != OBSTACLE)
        called = (plain(given[0]) if given else "").replace(" ", "_")[:40] or OBSTACLE
        self.unknown[given[-1][:40] if given else "", called] += 1
        return called, False

    def meant(self, name: str) -> str | None:
        """Return the category that a name means, `rug` for rugs; None for obstacles, decor and unknown names."""
        if name in self.categories:
            return name
        found = self._key(name)
        return None if found in (OBSTACLE, DECOR) else found

    def kind(self, *names: str | None) -> str | None:
        """Return the category of a thing with these names; None for obstacles, decor, rugs and unknown names."""
        found = self._key(*names)
        return None if found in (OBSTACLE, *NOT_FURNITURE) else found

    def knows(self, *names: str | None) -> bool:
        """Whether a name is that of a category."""
        return self.kind(*names) is not None

    def is_decor(self, *names: str | None) -> bool:
        """Whether a name is that of decor, or of a rug."""
        return self._key(*names) in NOT_FURNITURE

    def ours(self, document: Any) -> Any:
        """Return a room's document with known names of furniture replaced by categories; all else is unchanged."""
        if not isinstance(document, dict) or not isinstance(document.get("furniture"), list):
            return document
        return document | {"furniture": [self._named(entry) for entry in document["furniture"]]}

    def _named(self, entry: Any) -> Any:
        name = entry.get("category") if isinstance(entry, dict) else None
        if not isinstance(name, str) or (ours := self.meant(name)) is None:
            return entry
        return entry | {"category": ours}

    def _key(self, *names: str | None) -> str | None:
        """Return the key of the table that has a thing of these names: a category, or what is none; None if unknown."""
        return self._furniture.get(self._known([name for name in names if name]) or "")

    def _known(self, names: list[str]) -> str | None:
        """Return the table's name for a thing of these names, or None. Names of SHAPES count only if no other does."""
        said = [name for name in names if not SHAPES.issuperset(plain(name).split())]
        return self._found(said) or self._found(names)

    def _found(self, names: list[str]) -> str | None:
        """Return the table's name for a thing with these names, each of which may have several parts, or None."""
        return self._saying([*map(self._leading, chain.from_iterable(map(_parts, names)))])

    def _saying(self, parts: list[str]) -> str | None:
        """Return the table's name for a thing with these plain names, none of which joins several, or None.

        It is the first that the table has of: the whole names; the longest words that one ends with; the longest end
        of a word of a language without spaces; the longest words that one begins with, where these count (`_begins`).
        In English the last words tell what a thing is: a blue loft bed is a bed, and a bed lamp is none. If there is
        none, English plurals are taken for what they are several of.
        """
        words = [part.split() for part in parts]
        ends = (" ".join(each[first:]) for each in words for first in range(1, len(each)))
        unspaced = (word for each in words for word in reversed(each) if UNSPACED.search(word))
        ends_of_word = (word[first:] for word in unspaced for first in range(1, len(word)))
        begins = chain.from_iterable(map(self._begins, words))
        found = next((p for p in chain(parts, ends, ends_of_word, begins) if p in self._furniture), None)
        single = [*map(_single, parts)]
        return found if found or single == parts else self._saying(single)

    def _leading(self, part: str) -> str:
        """Return the part of a plain name that tells what it is: "bed" in "bed with nightstands".

        Of names joined by "and" it is the first of a known category, so that a lamp does not hide a table; if that is
        a seat and there is a desk or table, it is the latter. Else it is the first obstacle, else the whole name. A
        name that the table has as a whole, such as "cabinet with basin", is not split.
        """
        first = WITH.split(part, maxsplit=1)[0].strip()
        part = part if not first or self._goes_on(first, part) else first
        names = [*self._joined(part)]
        if len(names) < 2:
            return part
        found = {name: self._furniture.get(self._saying([name]) or "", DECOR) for name in names}
        placed = [name for name in names if found[name] not in (OBSTACLE, *NOT_FURNITURE)]
        seated = [name for name in placed if found[name] in HOSTS] if placed and found[placed[0]] in SEATS else []
        standing = [name for name in names if found[name] == OBSTACLE]
        return next(chain(seated, placed, standing), part)

    def _joined(self, part: str) -> Iterator[str]:
        """Yield the names that "and" joins in a plain name. A name that the table has as a whole is not split."""
        while part:
            first, *others = AND.split(part, maxsplit=1)
            if not others or self._goes_on(first, part):
                yield part
                return
            if first.strip():
                yield first.strip()
            part = others[0].strip()

    def _goes_on(self, first: str, part: str) -> bool:
        """Whether a name of the table runs from a word of `first`, with which `part` begins, to the end of `part`."""
        return any(part[at.start() :] in self._furniture for at in re.finditer(r"\S+", first))

    def _begins(self, words: list[str]) -> Iterator[str]:
        """Yield the beginnings of a name that tell what it is, the longest first.

        In Romance languages the first words do, and names with a star in the table are such: a "lit double" is a bed.
        Any others do where nothing but a size follows: a "sofa 3 seater" is a sofa.
        """
        for last in range(len(words) - 1, 0, -1):
            begin = " ".join(words[:last])
            if begin in self._first or SIZE_WORDS.issuperset(words[last:]):
                yield begin

    def room_type(self, name: str | None, furniture: Iterable[str]) -> str | None:
        """Return the type of a room by its name, else by the categories in it; None if neither tells it.

        NO_ROOM stands for a room that nobody furnishes. If the name joins several rooms, the first in the table
        counts; what a room is "with" or "without" is ignored.
        """
        parts = [WITH.split(plain(part))[0] for part in SIGNS.split(_spelled(name or ""))]
        found = {self._room(part) for part in parts}
        for named, ours in self._rooms.items():
            if named in found:
                return ours
        held = set(furniture)
        return next((room_type for room_type, telling in TELLING.items() if telling & held), None)

    def _room(self, part: str) -> str | None:
        """Return the table's name for a room with this plain name, or None: one with a star, else the table's first.

        Names within longer ones do not count. In a language without spaces, the one that ends last comes first.
        """
        held = [named for named in self._rooms if _holds(part, named)]
        whole = [named for named in held if not any(_holds(other, named) for other in held if other != named)]
        if UNSPACED.search(part):
            whole.sort(key=lambda named: -(part.rfind(named) + len(named)))
        return next((named for named in whole if named in self._winning), whole[0] if whole else None)

    def notes(self) -> list[str]:
        """Return a line for each unknown name, the most frequent first, and for what has none; NOTED at most."""
        known = self.categories
        lines = []
        for (name, called), times in self.unknown.most_common(NOTED):
            if not name:
                lines.append(f"furniture without a name ({times}) stands as an obstacle")
                continue
            near = difflib.get_close_matches(called, known, 3, 0)
            lines.append(
                f"{name!r} ({times}) is no known furniture and stands as an obstacle; nearest are {', '.join(near)} "
                "(categories=<file> names it)"
            )
        return lines


def nearest(name: str, known: Collection[str]) -> list[str]:
    """Up to three known categories that a name may mean: what the table says it is, then what is spelled alike."""
    ours = own_names().meant(name) or ""
    alike = difflib.get_close_matches(name, known, 3, 0)
    return [*dict.fromkeys([ours, *alike] if ours in known else alike)][:3]


def names_in(said: str | None) -> set[str]:
    """Return the names in a comma-separated list, such as `move` and `only`; empty for None."""
    return set() if said is None else {name.strip() for name in said.split(",")}


def plain(name: str) -> str:
    """Return a name in lower case without catalogue, accents, numbers and signs: eTeks#bed140x190 becomes "bed"."""
    name = re.sub(r"^\S*#(?=[^\W\d_])", "", name[:LONGEST])  # but "Bedroom #2" and "Bedroom #B" have no catalogue
    name = re.sub(r"(?<=[^\W\d_])\s*[&+]\s*(?=[^\W\d_])", " and ", name)
    name = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    decomposed = unicodedata.normalize("NFKD", name).casefold()
    letters = "".join(c for c in decomposed if not unicodedata.combining(c))
    return " ".join(re.findall(r"[^\W\d_]+", re.sub(r"\d+(x\d+)*", " ", letters)))


def _single(part: str) -> str:
    """Return a plain name with an English plural at its end as a singular; else the name."""
    return next((re.sub(plural, single, part) for plural, single in PLURALS if re.search(plural, part)), part)


def _holds(part: str, named: str) -> bool:
    """Whether a plain name contains another as whole words, or anywhere in a language without spaces."""
    return named in part if UNSPACED.search(named) else f" {named} " in f" {part} "


def _spelled(name: str) -> str:
    """Return a name, shortened, with *with* in place of "w/": a slash parts names.

    A w/d is a washer and dryer, a w/c a toilet: neither means with.
    """
    name = re.sub(r"\bw/d\b", "w d", name[:LONGEST], flags=re.IGNORECASE)
    return re.sub(r"\bw/(?!c\b)", "with ", name, flags=re.IGNORECASE)


def _parts(name: str) -> list[str]:
    """Return the plain name, then its parts between slashes, last first, up to a dash: "table/coffee table - round"."""
    name = _spelled(name)
    name = BRACKETS.sub(" ", name).strip() or name
    parts = [part.partition(" - ")[0] for part in reversed(name.split("/"))]
    return [plain(part) for part in (name, *parts)]


def names_of(file: Path | str | None = None) -> Names:
    """Return the names of the package's table and of a user's file, which win. Raises InputError if it is unusable."""
    return Names(_own_table()) if file is None else Names(_own_table(), _users(Path(file)))


@cache
def own_names() -> Names:
    """Return the names of the package's table, made once: for look-ups where nobody asks for `unknown`."""
    return names_of()


@cache
def _own_table() -> dict[str, list[str]]:
    text = files("layoutrl.rooms").joinpath("categories.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)


def _users(file: Path) -> dict[str, list[str]]:
    expected = "expected a YAML file as `sofa: [couch, settee]`, a list of names for each category"
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise InputError(f"categories: {file} is larger than 1 MB; {expected}")
        table = yaml.safe_load(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"categories: {file} cannot be read ({error.strerror}); {expected}") from None
    except (ValueError, RecursionError, yaml.YAMLError) as error:
        line = getattr(getattr(error, "problem_mark", None), "line", None)
        where = "" if line is None else f":{line + 1}"
        raise InputError(f"categories: {file}{where} is no YAML; {expected}") from None
    if not isinstance(table, dict):
        raise InputError(f"categories: {file}: {expected}; got no categories")
    for ours, theirs in table.items():
        names = isinstance(theirs, list) and all(isinstance(name, str) and plain(name) for name in theirs)
        if not isinstance(ours, str) or not names:
            raise InputError(f"categories: {file}: {str(ours)[:40]}: {expected}")
    return table
