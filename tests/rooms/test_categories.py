from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.rooms import categories
from layoutrl.rooms.categories import DECOR, DESIGNED, HOLDS, NO_ROOM, OBSTACLE, RUG, TELLING, names_of, plain
from layoutrl.rooms.clearances import FRONT_DEPTH, RUGS
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.runs.pretrained import cards

ROOMS_PAGE = Path(__file__).parents[2] / "docs" / "rooms.md"


@pytest.mark.parametrize(
    ("name", "category"),
    [
        ("eTeks#bed140x190", "bed"),
        ("eTeks#bedsideTable", "nightstand"),
        ("eTeks#washbasinWithCabinet", "vanity"),
        ("Kator Legaz#office-chair", "chair"),
        ("DiningTable", "table"),
        ("TVStand", "tv_unit"),
        ("bed/king-size bed", "bed"),
        ("table/coffee table - round", "coffee_table"),
        ("sofa/ multi seat sofa", "sofa"),
        ("Bookcase / jewelry Armoire", "bookcase"),
        ("Fauteuil", "armchair"),
        ("Évier", "sink"),
        ("Blue loft bed", "bed"),
        ("eTeks#filledBookcase", "bookcase"),
        ("Cabinet with basin", "vanity"),
        ("Doppelbett", "bed"),
        ("Esstisch", "table"),
        ("Schrank", "wardrobe"),
        ("Lavadora", "washing_machine"),
        ("Lit double", "bed"),  # it begins with a bed, and ends with nothing that is known
        ("Cama doble 140", "bed"),
        ("Table à manger", "table"),
        ("Table basse ronde", "coffee_table"),  # the longest that it begins with
        ("Dining table 6 seats", "table"),
        ("Bed 160x200", "bed"),
        ("Sofa 3 seater", "sofa"),
        ("Armoire 2 portes", "wardrobe"),
        ("Mesa de noche blanca", "nightstand"),
        ("Commode lampe table", "table"),  # an end before a beginning
        ("Chaise de bureau", "chair"),
        ("Canapé lit", "sofa_bed"),
        ("Meuble TV", "tv_unit"),
        ("布艺沙发", "sofa"),  # no blanks part its words
        ("实木衣柜 200cm", "wardrobe"),
        ("沙发 XL", "sofa"),
        ("宜家 sofa", "sofa"),
        ("Sofa left", "sofa"),
        ("Nachttisch links", "nightstand"),
        ("Table round", "table"),
        ("Bed (guest)", "bed"),
        ("(bed)", "bed"),
    ],
)
def test_names_of_other_programs_are_known(name: str, category: str) -> None:
    names = names_of()
    assert names.category(name) == (category, True)
    assert names.knows(name)
    assert not names.notes()


def test_what_designs_hold_is_known_and_may_be_put_there() -> None:
    known = set(names_of().categories)
    assert set(FRONT_DEPTH) <= known
    for room_type in MAIN_ITEM:
        designed = {item.category for room in design_rooms(room_type, "train", 0, 12).rooms for item in room.furniture}
        assert designed <= DESIGNED[room_type] <= HOLDS[room_type] <= known
        assert DESIGNED[room_type] == {*cards()[room_type]["categories"]}
    assert set(TELLING) <= set(MAIN_ITEM)
    assert set(HOLDS) == set(MAIN_ITEM)


@pytest.mark.parametrize(
    ("category", "called"),
    [
        ("armchair", "Leather wing chair, Rocking chair, Schaukelstuhl, Mecedora de madera, Oude leunstoel, 扶手椅"),
        ("bookcase", "Schrankwand, Librero alto, Oak shelving, Billy wall unit"),
        ("bed", "Divan base, Double divan base, Divan bed base"),
        ("counter", "Base cupboard, Sink cupboard"),
        ("counter", "Kitchen drawers, Bancada de granito, Keukenblok, Kitchen base unit"),
        ("dresser", "Drawers, Changing table, Truhe, Gaveteiro branco"),
        ("lounge_chair", "Sun lounger, Liegestuhl, Tumbona plegable"),
        ("nightstand", "Bedside, Nachtkommode, Chevet 1 tiroir, Criado-mudo, Nachttafel"),
        ("sideboard", "China hutch, China cabinet, Highboard, Vitrine en chêne, Credenza antica"),
        ("sofa_bed", "Day bed, Pull-out sofa, Bettsofa, Banquette-lit, Dagbed"),
        ("stool", "Barstool, Bar chair, Pouf rond, 凳子"),
        ("tv_unit", "TV table, TV-Möbel, Wohnwand, Móvel TV, Parete attrezzata, TV-kast"),
        ("vanity", "Vanity unit, Pedestal sink, Lavabo doble, Mueble de baño, Mobile bagno sospeso, Wastafelmeubel"),
        ("wardrobe", "Cupboard, Schiebetürenschrank, Linnenkast, 衣橱"),
        ("washing_machine", "Dryer, Washer & dryer, Trockner, Lavarropas"),
    ],
)
def test_everyday_names_of_furniture_are_known(category: str, called: str) -> None:
    names = names_of()
    for name in called.split(", "):
        assert (name, names.category(name)) == (name, (category, True))
    for name in ("Hair dryer", "Game console", "Máquina de lavar louça", "Shoe cabinet", "Lave-vaisselle encastré"):
        assert not names.knows(name)


@pytest.mark.parametrize(
    ("called", "category"),
    [
        ("Bed with nightstands, Bed w/ nightstand, Bett mit Nachttischen, Lit avec tables de chevet", "bed"),
        ("cama con mesitas, letto con comodini, cama com mesas, bed met nachtkastjes, Bed and nightstand", "bed"),
        ("Blue bed with a desk and a chair, Bett & Nachttisch, lit et chevet, Cama doble con mesita de noche", "bed"),
        ("Desk with chair, Desk and chair, Desk & chair, Desk + chair", "desk"),
        ("Wardrobe with mirror", "wardrobe"),
        ("White cabinet with basin", "vanity"),  # which is in the table
        ("Fridge & Freezer", "fridge"),
        ("cabinet/hutch&buffet", "sideboard"),
        ("Kitchen and dining table", "table"),
        ("Tavolo e sedie, Mesa y sillas, Tisch und Stühle, Tafel en stoelen", "table"),
    ],
)
def test_what_a_piece_has_with_it_does_not_say_what_it_is(called: str, category: str) -> None:
    names = names_of()
    for name in called.split(", "):
        assert (name, names.category(name)) == (name, (category, True))
    assert names.category("Treadmill with table") == ("treadmill_with_table", False)
    assert names.category("Treadmill W/ table") == names.category("Treadmill w/table") == ("treadmill_w_table", False)
    assert names.category("Bed W/nightstand") == ("bed", True)
    for name in ("W/D", "w/d", "Closet W/D", "closet w/d", "W/D (washer/dryer)"):
        assert names.category(name) == (plain(name).replace(" ", "_"), False)
    assert names.category("Washer/dryer") == ("washing_machine", True)
    assert names.category("And", "& bed", "with") == ("bed", True)


@pytest.mark.parametrize(
    ("category", "called"),
    [
        ("bookcase", "Book and display shelf, Plant and book and shelf"),
        ("wardrobe", "Clothes and coat closet"),
        ("bench", "Window and bench, Mat and bench, Coat rack and bench"),
        ("desk", "Computer and writing desk, Chair and desk, Stool and desk, Silla y escritorio, Chair & desk & lamp"),
        ("tv_unit", "TV & media console, Fireplace & TV stand, tv_and_media_unit"),
        ("dresser", "Mirror and dresser"),
        ("side_table", "Plant & side table"),
        ("table", "Lamp and table, Chaise et table, Chaise et table ronde, Chaise en bois et table, Bench and table"),
        ("chair", "Chair and lamp, Chair and stool, Chair and bed"),
        ("armchair", "Armchair and table"),
    ],
)
def test_what_is_no_piece_does_not_hide_the_piece_behind_an_and(category: str, called: str) -> None:
    names = names_of()
    for name in called.split(", "):
        assert (name, names.category(name), names.meant(name)) == (name, (category, True), category)


def test_what_a_room_or_piece_has_or_lacks_does_not_say_what_it_is() -> None:
    names = names_of()
    for called in ("Bedroom w/ bath", "Bedroom w/bath", "Bedroom without bath", "Schlafzimmer ohne Bad", "Bedroom w/d"):
        assert (called, names.room_type(called, ())) == (called, "bedroom")
    assert names.room_type("Living room w/ kitchenette", ()) == "living_room"
    for called in ("Bed without headboard", "lit sans chevet", "Bed w/o headboard"):
        assert (called, names.category(called)) == (called, ("bed", True))


@pytest.mark.parametrize(
    "called",
    [
        "Towel dryer, Heated towel dryer, Hand dryer, Dish dryer, Nail dryer, Salad dryer, Boot dryer",
        "Xbox console, Games console, Gaming console, PS4 console, Playstation console, Mixer console, Mixing console",
        "Control console, Radio console, Video game console",
        "Hutch, Desk hutch, Rabbit hutch",
        "Desk drawers, Under-bed drawers, Underbed drawers, Sink drawers, Under sink drawers",
        "Shoe cupboard, Medicine cupboard, Wall cupboard, Kitchen wall cupboard, Broom cupboard, Larder cupboard",
        "Airing cupboard, Meter cupboard, Vacuum cleaner and broom cupboard",
        "Ironing workstation, Kitchen workstation, Kitchen wall unit",
    ],
)
def test_what_only_ends_like_a_piece_stays_in_the_way(called: str) -> None:
    names = names_of()
    for name in called.split(", "):
        assert (name, names.knows(name)) == (name, False)
        assert names.category(name) is not None


def test_of_names_with_an_and_an_obstacle_is_in_the_way_and_none_is_lost() -> None:
    names = names_of()
    assert names.category("Lamp and mirror") == names.category("Lamp and curtain") == ("lamp", False)
    assert names.category("Book and lamp") == ("lamp", False)
    assert names.category("Book and gizmo") == ("book_and_gizmo", False)
    assert names.category("Book and boots") is None
    assert names.category("e y " * 50) == (("e_y_" * 50)[:40], False)  # soon


def test_only_a_shape_is_what_its_user_calls_it() -> None:
    names = names_of()
    for shape in ("eTeks#box", "eTeks#texturableBox", "Half cylinder", "Half sphere", "Texturable triangle"):
        assert names.category(shape, "My wardrobe") == ("wardrobe", True)
        assert names.category(shape, "Lamp") == ("lamp", False)
    for piece in ("Litter box", "Window box", "Music box"):
        assert not names.knows(piece, "Dog's bed")
    assert names.category("Litter box", "Bed") == ("litter_box", False)
    assert names.category("Bed", "Toy box") == names.category("Blue bed", "Toy box") == ("bed", True)
    assert names.category("eTeks#box", "Toy box") == ("box", False)


@pytest.mark.parametrize(
    ("category", "called"),
    [
        ("wardrobe", "wardrobes, Oak wardrobes, Closets"),
        ("sofa", "Sofas, couches"),
        ("bench", "Benches"),
        ("vanity", "Vanities, double vanities"),
        ("dresser", "Chests"),
        ("coffee_table", "coffee_tables, Coffee Tables with lamps"),
        ("bed", "Beds, Twin beds, loft beds 90x200"),
        ("table", "Tables and chairs, tables"),
    ],
)
def test_an_english_plural_is_what_it_is_several_of(category: str, called: str) -> None:
    names = names_of()
    for name in called.split(", "):
        assert (name, names.category(name)) == (name, (category, True))
    for name in ("lamps", "dressing tables", "glass", "Towel dryers"):
        assert names.category(name) is not None
        assert not names.knows(name)
    assert names.category("books") is None  # decor


@pytest.mark.parametrize(
    ("plural", "single"),
    [("benches", "bench"), ("brushes", "brush"), ("glasses", "glass"), ("boxes", "box"), ("vanities", "vanity"),
     ("beds", "bed"), ("oak wardrobes", "oak wardrobe"), ("glass", "glass"), ("bed", "bed"), ("", "")],
)  # fmt: skip
def test_the_singular_of_an_english_plural(plural: str, single: str) -> None:
    assert categories._single(plural) == single


def test_an_island_does_not_go_to_a_wall_as_counters_do() -> None:
    names = names_of()
    for name in ("Kitchen island", "Kücheninsel", "Îlot de cuisine", "Isla de cocina", "Breakfast bar"):
        assert names.category(name) == (plain(name).replace(" ", "_"), False)


@pytest.mark.parametrize("name", ["Rug", "Carpet", "area rug", "Teppich 200x300", "Tapis rond", "alfombra", "地毯"])
def test_a_rug_is_floor_by_whichever_name(name: str) -> None:
    names = names_of()
    assert names.meant(name) in RUGS
    assert names.category(name) is None  # in a home
    assert names.is_decor(name)
    assert not names.knows(name)
    assert names.category("mattress") == ("mattress", False)


def test_obstacles_are_called_as_they_are_and_decor_is_nothing() -> None:
    names = names_of()
    assert names.category("Piano") == ("piano", False)
    assert names.category("pendant lamp") is None
    assert not names.knows("Piano", "pendant lamp", None)
    assert names.category("bed reading lamp") == ("lamp", False)
    for name in ("宠物床", "tapis roulant", "tappeto elastico"):
        assert not names.knows(name)
        assert names.category(name) is not None
    assert names.category("Shower curtain") is None
    assert names.category("Dish washer") == ("dish_washer", False)
    assert names.category("Lamp (bed)") == ("lamp", False)
    assert names.category("Rug round") is None
    assert names.category("Vanity table") == ("vanity_table", False)  # as a dressing table, and no dining table
    assert names.category("Lampe de bureau") == ("lampe_de_bureau", False)
    assert names.category("Window seat") == ("window_seat", False)
    assert names.category("Lampe", "bed") == ("bed", True)  # a whole name comes before the end of another


@pytest.mark.parametrize(
    "name",
    [
        *("bath scale", "shower screen", "ShowerGlass", "ToiletPaperHanger", "toilet brush", "toilet plunger"),
        *(
            "toilet roll",
            "range hood",
            "oven hood",
            "StoveKnob",
            "stove pipe",
            "desk fan",
            "desk monitor",
            "bed canopy",
        ),
        *("bed ladder", "bed tray", "table saw", "silla de ruedas", "plant tub"),
    ],
)
def test_what_is_called_after_a_piece_is_an_obstacle(name: str) -> None:
    names = names_of()
    assert names.category(name) == (plain(name).replace(" ", "_"), False)
    assert not names.knows(name)


@given(st.text(max_size=30), st.text(max_size=30))
def test_any_name_is_answered(one: str, other: str) -> None:
    names = names_of()
    found = names.category(one, other)
    assert found is None or (found[0] and found[1] == names.knows(one, other))
    assert all("\n" not in note for note in names.notes())
    assert plain(plain(one)) == plain(one)


def test_a_room_is_what_its_name_says_else_what_stands_in_it() -> None:
    names = names_of()
    assert names.room_type("Bedroom #2", ["toilet"]) == "bedroom"
    assert names.room_type("Bedroom #B", ["toilet"]) == "bedroom"
    chinese = {
        "主卧室": "bedroom",
        "次卧室 2": "bedroom",
        "主卫生间": "bathroom",
        "客厅阳台": "balcony",
        "主卧衣帽间": NO_ROOM,
    }
    assert {name: names.room_type(name, []) for name in chinese} == chinese
    assert names.room_type("LivingDiningRoom", []) == "living_room"
    assert names.room_type("Salle de bains", []) == "bathroom"
    assert names.room_type("Corridor", ["bed"]) == NO_ROOM
    assert names.room_type("Otto", ["chair", "toilet", "bed"]) == "bathroom"
    assert names.room_type(None, ["chair"]) is None
    assert names.room_type("", ["sink"]) == "kitchen"
    assert names.room_type("Utility 2", []) == NO_ROOM


@pytest.mark.parametrize(
    ("room_type", "called"),
    [
        (
            "bathroom",
            "Badezimmer, Ensuite, Master en suite, Powder room, Salle d'eau, Toilettes, Gäste-WC, Bath/Laundry",
        ),
        ("kitchen", "Wohnküche, Keuken, Kitchen/Pantry, Angolo cottura, Kochnische"),
        ("balcony", "Patio, Back porch, Dachterrasse"),
        ("living_room", "Salotto, Huiskamer, Wohn-Esszimmer, Wohn- und Esszimmer, Front room, Zona giorno"),
        ("dining_room", "Breakfast nook, Essplatz, Eethoek"),
        ("study", "Workroom, Bibliothèque, Ufficio, Studeerkamer, 办公室"),
        ("bedroom", "Suite, Primary suite, Baby room, Mädchenzimmer, Stanza da letto, Alcoba, 客房"),
        ("bathroom", "Kinderbad, Gästetoilette, 客卫, Suite bathroom"),
        (NO_ROOM, "Vestibule, Entry, Storeroom, Garderobe, Disimpegno, Entrada, Hal, Trappenhuis, 楼梯间"),
        ("living_room", "Family room, Woonkamer, Wohnen/Essen, Salon/Salle à manger"),
        ("dining_room", "Dining hall, Sala da pranzo"),
        ("study", "Büro, Home office, Despacho"),
        ("bedroom", "Kinderzimmer, Gästezimmer, Master suite, Guest room 2, Habitación, Slaapkamer, Children's room"),
        ("bedroom", "Bedroom with closet, Bedroom + closet, Bedroom and closet, Bedroom with ensuite, Ensuite bedroom"),
        ("bedroom", "Bedroom ensuite, Bedroom + ensuite, Schlafzimmer mit Bad"),
        ("bathroom", "Quarto de banho, Water closet, Ensuite bathroom"),
        ("bathroom", "Salle de douche, Master bath, Kids bathroom, Guest WC"),
        ("bedroom", "Master, Kids, Guest, Bed 1, Family bedroom"),
        ("living_room", "Family, Pièce de vie"),
        ("no_room", "Master closet, Master dressing, Guest entrance"),
        (NO_ROOM, "Living room closet, Dining room closet, Library closet, Children's room closet, Master bath closet"),
        (NO_ROOM, "Bedroom walk-in wardrobe, Master bath walk-in closet, Kitchen walk-in pantry"),
        (NO_ROOM, "Bedroom Closet, Bedroom 2 closet, Walk-in closet, Master closet, Pantry, Kitchen pantry, Laundry"),
        (NO_ROOM, "Abstellraum, Buanderie"),
        (NO_ROOM, "Entrance porch, Garage deck, Stairs deck, Laundry suite, Dressing suite, Suite hall"),
        ("bedroom", "Patio bedroom, Deck bedroom, Guest suite, Bedroom/Porch"),
        ("balcony", "Porch, Deck, Pool deck"),
    ],
)
def test_everyday_names_of_rooms_are_known(room_type: str, called: str) -> None:
    names = names_of()
    for name in called.split(", "):
        assert (name, names.room_type(name, ["bed", "sink"])) == (name, room_type)


def test_each_name_of_the_table_means_what_its_list_says() -> None:
    text = files("layoutrl.rooms").joinpath("categories.yaml").read_text(encoding="utf-8")
    names = names_of()
    for ours, theirs in yaml.safe_load(text).items():
        for name in theirs:
            if ours in (*MAIN_ITEM, NO_ROOM):
                assert (name, names.room_type(name, [])) == (name, ours)
            elif ours == OBSTACLE:
                assert names.category(name) == (plain(name).replace(" ", "_"), False)
            else:
                assert (name, names.category(name)) == (name, None if ours in (DECOR, RUG) else (ours, True))


def test_a_users_file_adds_names(tmp_path: Path) -> None:
    file = tmp_path / "my.yaml"
    file.write_text("sofa: [Sitzlandschaft]\nbar: [Hausbar]\nbedroom: [Kajüte]\n", encoding="utf-8")
    names = names_of(file)
    assert names.category("Sitzlandschaft") == ("sofa", True)
    assert names.category("Hausbar") == ("bar", True)
    assert names.room_type("Kajüte 2", []) == "bedroom"
    assert names.category("couch") == ("sofa", True)
    assert names_of().category("Sitzlandschaft") == ("sitzlandschaft", False)


@pytest.mark.parametrize(("first", "second"), [("armchair", "wardrobe"), ("wardrobe", "armchair")])
def test_a_users_names_win_over_ours(tmp_path: Path, first: str, second: str) -> None:
    """Wherever in our table the name stands, and the category that the user has for it."""
    own = yaml.safe_load(files("layoutrl.rooms").joinpath("categories.yaml").read_text(encoding="utf-8"))
    file = tmp_path / "my.yaml"
    file.write_text(f"{first}: [{own[second][-1]}, {second}]\nbedroom: [Utility]\n{NO_ROOM}: [Bedroom]\n")
    names = names_of(file)
    assert names.category(own[second][-1]) == names.category(second) == (first, True)
    assert names.room_type("Utility 2", []) == "bedroom"
    assert names.room_type("Bedroom 2", ["bed"]) == NO_ROOM
    assert names.room_type("Kitchen / Bedroom", []) == names_of().room_type("Kitchen / Utility", [])


@pytest.mark.parametrize(
    "text", ["sofa: couch", "- sofa", "sofa: [1]", "a: [b", "", "1: [a]", "sofa: ['#']", "&a [*a]"]
)
def test_a_file_that_is_no_table_is_answered_in_one_line(text: str, tmp_path: Path) -> None:
    (tmp_path / "my.yaml").write_text(text)
    with pytest.raises(InputError, match=r"categories: .*expected a YAML file as") as caught:
        names_of(tmp_path / "my.yaml")
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="cannot be read"):
        names_of(tmp_path / "none.yaml")


def test_the_page_lists_the_known_categories() -> None:
    page = " ".join(ROOMS_PAGE.read_text(encoding="utf-8").split())
    listed = page.split("The known categories are ")[1].split(". ")[0]
    assert sorted(name.strip("`") for name in listed.split(", ")) == names_of().categories
    for word in (OBSTACLE, DECOR, NO_ROOM):
        assert f"`{word}`" in page


@pytest.mark.parametrize("document", [
    None, 1, [], {}, {"furniture": None}, {"furniture": {"category": "Bett"}},
    {"furniture": [None, 1, {}, {"category": None}, {"category": ["Bett"]}, {"category": "treadmill"}]},
    {"furniture": [{"category": "sofa_bed"}, {"category": "Lampe"}], "category": "Bett"},
])  # fmt: skip
def test_a_document_is_as_it_was_but_for_names_of_categories(document: Any) -> None:
    assert names_of().ours(document) == document


def test_a_documents_furniture_is_called_by_its_categories() -> None:
    given = {"id": "Bett", "furniture": [{"category": "Bett", "size": [2, 1]}, {"category": "Couch"}]}
    assert names_of().ours(given) == {
        "id": "Bett", "furniture": [{"category": "bed", "size": [2, 1]}, {"category": "sofa"}]
    }  # fmt: skip
    assert given["furniture"][0]["category"] == "Bett"


def test_nothing_is_near_to_furniture_without_a_name() -> None:
    names = names_of()
    assert [names.category(None, " "), names.category()] == [("obstacle", False)] * 2
    assert names.notes() == ["furniture without a name (2) stands as an obstacle"]
