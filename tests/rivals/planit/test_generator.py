"""The graph generator: what it is asked is what the graph says, and what it draws is a graph."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from layoutrl.rivals.planit.generator import (
    Decision,
    GraphNetwork,
    Partial,
    architecture,
    decisions,
    loss,
    sample,
    with_items,
)
from layoutrl.rivals.planit.graph import (
    ARCHITECTURE,
    TYPES,
    Graph,
    KeptTypes,
    Relation,
    Scene,
    graph_of,
    kept_types,
    scene_of,
)
from layoutrl.rooms.designer.generator import design_rooms

SCENES = [scene_of(room) for room in design_rooms("bedroom", "train", 5, 6).rooms]
NAMES = [*ARCHITECTURE, *sorted({scene.category[k] for scene in SCENES for k in scene.items})]
KEPT = kept_types(SCENES)


@pytest.fixture(scope="module")
def network() -> GraphNetwork:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        return GraphNetwork(len(NAMES))


def graph(scene: Scene) -> Graph:
    return graph_of(scene, KEPT, list(scene.items))


def test_every_decision_is_one_that_leads_to_the_rooms_graph() -> None:
    rng = np.random.default_rng(0)
    ends = 0
    for _ in range(200):
        scene = SCENES[int(rng.integers(len(SCENES)))]
        own = graph(scene)
        items = list(own)
        done = int(rng.integers(len(items) + 1))
        node, edges = decisions(scene, own, done, NAMES, rng)
        assert [NAMES[c] for c in node.graph.category[scene.fixed :]] == [scene.category[k] for k in items[:done]]
        if done == len(items):
            assert node.right == len(NAMES)
            assert not edges
            ends += 1
            continue
        assert NAMES[node.right] == scene.category[items[done]]
        leading = {(r.anchor, r.type) for r in own[items[done]]}
        for come_from, decision in edges.items():
            there = {(a, t) for a, b, t, _ in decision.graph.edges if b == scene.fixed + done}
            assert there <= leading
            anchors = range(scene.fixed) if come_from == "architecture" else range(scene.fixed, scene.fixed + done)
            left = {(a, t) for a, t in leading - there if a in anchors}
            if decision.right == len(anchors) * len(TYPES):
                assert not left
            else:
                anchor, type = divmod(decision.right, len(TYPES))
                assert (anchors[anchor], type) in left
    assert ends


@torch.no_grad()
def test_a_decision_does_not_hang_on_the_rooms_that_it_is_learned_with(network: GraphNetwork) -> None:
    partials = [architecture(scene, NAMES) for scene in SCENES]
    together = network.next_node(partials)
    for k, partial in enumerate(partials):
        torch.testing.assert_close(together[k], network.next_node([partial])[0])
    with_new = [with_items(partial, [len(ARCHITECTURE)], []) for partial in partials]
    together_edges = network.next_edge(with_new, "architecture")
    for partial, found in zip(with_new, together_edges, strict=True):
        torch.testing.assert_close(found, network.next_edge([partial], "architecture")[0])
        assert len(found) == (len(partial.category) - 1) * len(TYPES) + 1
        assert found[-1] == pytest.approx(np.log(10))


def test_states_follow_the_graph_and_not_the_numbers_of_its_nodes(network: GraphNetwork) -> None:
    partial = architecture(SCENES[0], NAMES)
    order = np.random.default_rng(0).permutation(len(partial.category))
    place = np.argsort(order)
    shuffled = Partial(
        [partial.category[k] for k in order],
        [partial.length[k] for k in order],
        [(int(place[a]), int(place[b]), type, turn) for a, b, type, turn in partial.edges],
    )
    torch.testing.assert_close(network.next_node([partial]), network.next_node([shuffled]))


def test_it_never_puts_a_wall_into_a_room(network: GraphNetwork) -> None:
    logits = network.next_node([architecture(SCENES[0], NAMES)])[0]
    assert torch.isinf(logits[: len(ARCHITECTURE)]).all()
    assert torch.isfinite(logits[len(ARCHITECTURE) :]).all()


def test_what_is_drawn_is_a_graph_of_kept_edges_that_leads_forwards(network: GraphNetwork) -> None:
    rng = np.random.default_rng(0)
    for scene in SCENES:
        names, drawn = sample(network, scene, NAMES, KEPT, 5, rng)
        assert len(names) == len(drawn) <= 5
        for k, (node, edges) in enumerate(drawn.items()):
            assert node == scene.fixed + k
            assert len({r.anchor for r in edges}) == len(edges)
            for r in edges:
                assert r.target == node
                assert r.anchor < node
                anchor = scene.category[r.anchor] if r.anchor < scene.fixed else names[r.anchor - scene.fixed]
                assert (anchor, names[k], r.type) in KEPT


def test_given_categories_and_known_edges_are_taken_over(network: GraphNetwork) -> None:
    scene = SCENES[0]
    given = [scene.category[k] for k in scene.items]
    own = graph(scene)
    known = list(own.values())[:-1]
    names, drawn = sample(network, scene, NAMES, KEPT, 1, np.random.default_rng(0), given, known)
    assert names == given
    assert list(drawn.values())[:-1] == known


def test_where_nothing_is_kept_nothing_is_drawn(network: GraphNetwork) -> None:
    given = [SCENES[0].category[k] for k in SCENES[0].items]
    _, drawn = sample(network, SCENES[0], NAMES, KeptTypes({}), 9, np.random.default_rng(0), given)
    assert not any(drawn.values())


def test_it_learns_one_room_by_heart() -> None:
    """Overfit: the only graph that it saw is the one that it draws."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        network = GraphNetwork(len(NAMES))
    scene, rng = SCENES[1], np.random.default_rng(0)
    own = graph(scene)
    optimizer = torch.optim.Adam(network.parameters(), 2e-3)
    for _ in range(400):
        made = [decisions(scene, own, int(rng.integers(len(own) + 1)), NAMES, rng) for _ in range(8)]
        edges: dict[str, list[Decision]] = {
            side: [found[side] for _, found in made if side in found] for side in ("furniture", "architecture")
        }
        optimizer.zero_grad()
        loss(network, [node for node, _ in made], edges).backward()
        optimizer.step()
    names, drawn = sample(network, scene, NAMES, KEPT, 9, np.random.default_rng(1))
    assert names == [scene.category[k] for k in own]
    expected = {Relation(r.anchor, r.target, r.type) for edges in own.values() for r in edges}
    got = {r for edges in drawn.values() for r in edges}
    assert len(got & expected) >= 0.8 * len(expected)
