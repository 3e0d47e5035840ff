"""PlanIT's graph generator (Wang et al. 2019, section 5): nodes and edges one after the other, as in Li et al. 2018.

Each decision is made by message passing along the edges of the graph so far: which category comes next, if any; then,
for the new node, which edges lead to it from the furniture that is there, one after the other; then which from walls,
doors and windows. Each of the three has weights of its own. Node states are computed anew for each decision, so that
it depends on the graph alone and decisions of many rooms are learned at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import pad_sequence

from layoutrl.rivals.planit.graph import (
    ADJACENT,
    ARCHITECTURE,
    FRONT,
    TYPES,
    Graph,
    KeptTypes,
    Relation,
    Scene,
    edge_type,
)

STATE, HIDDEN, ROUNDS = 64, 128, 3
NO_EDGE = math.log(10)  # the logit of adding no further edge; all others are learned relative to it
MOST_EDGES = 10  # to one node from furniture, and as many from architecture
REDRAWS = 10  # of edges to an item, until one leads to it
UNLIKELY = 0.002  # edges are not drawn below this probability


@dataclass(frozen=True)
class Partial:
    """A graph so far. Its nodes, architecture first, have a category and a length in metres, 0 for furniture."""

    category: list[int]
    length: list[float]
    edges: list[tuple[int, int, int, float]]  # from, to, type, sine of the turn from wall to wall


def architecture(scene: Scene, categories: Sequence[str]) -> Partial:
    """The graph of a room without furniture. `categories` begin with those of ARCHITECTURE."""
    sides = (scene.box[:, 2:] - scene.box[:, :2]).max(1)
    frame = [(a, b, edge_type(FRONT, ADJACENT), turn) for a, b, turn in scene.frame]
    fixed = range(scene.fixed)
    return Partial([categories.index(scene.category[k]) for k in fixed], [float(sides[k]) for k in fixed], frame)


def with_items(partial: Partial, categories: Sequence[int], edges: Sequence[Relation]) -> Partial:
    """Return the graph with further nodes, of length 0, and further edges between any nodes."""
    return Partial(
        partial.category + list(categories),
        partial.length + [0.0] * len(categories),
        partial.edges + [(*edge, 0.0) for edge in edges],
    )


def mlp(inputs: int, outputs: int) -> nn.Sequential:
    """Two linear layers with a leaky ReLU between them."""
    return nn.Sequential(nn.Linear(inputs, HIDDEN), nn.LeakyReLU(), nn.Linear(HIDDEN, outputs))


class Messages(nn.Module):
    """Computes node states in ROUNDS of messages along the edges, forwards and backwards."""

    def __init__(self, categories: int):
        super().__init__()
        features = categories + 1
        self.first = mlp(features, STATE)
        inputs = 2 * (STATE + features) + len(TYPES) + 1
        self.forwards = nn.ModuleList(mlp(inputs, STATE) for _ in range(ROUNDS))
        self.backwards = nn.ModuleList(mlp(inputs, STATE) for _ in range(ROUNDS))
        self.update = nn.ModuleList(nn.GRUCell(STATE, STATE) for _ in range(ROUNDS))

    def forward(self, features: Tensor, ends: Tensor, edge: Tensor) -> Tensor:
        """Return (N, STATE) from nodes (N, categories + 1), the ends (E, 2) of edges, their types and turns (E, 14)."""
        state = self.first(features).tanh()
        for forwards, backwards, update in zip(self.forwards, self.backwards, self.update, strict=True):
            node = torch.cat([state, features], 1)
            both = torch.cat([node[ends[:, 0]], node[ends[:, 1]], edge], 1)
            heard = torch.zeros_like(state)
            heard = heard.index_add(0, ends[:, 1], forwards(both)).index_add(0, ends[:, 0], backwards(both))
            state = update(heard, state)
        return state


class Pool(nn.Module):
    """Computes the state of each graph: a gated sum over its nodes."""

    def __init__(self) -> None:
        super().__init__()
        self.say, self.count = mlp(STATE, 2 * STATE), mlp(STATE, 2 * STATE)

    def forward(self, state: Tensor, graph: Tensor, graphs: int) -> Tensor:
        """Return (graphs, 2 STATE) from states (N, STATE) of nodes, which belong to graphs (N,)."""
        said = self.say(state) * self.count(state).sigmoid()
        return torch.zeros(graphs, 2 * STATE, device=state.device).index_add(0, graph, said)


class GraphNetwork(nn.Module):
    """The networks of the three decisions. Nodes have `categories` categories, architecture first."""

    def __init__(self, categories: int):
        super().__init__()
        self.categories = categories
        self.messages = nn.ModuleDict({name: Messages(categories) for name in ("node", "furniture", "architecture")})
        self.pool = nn.ModuleDict({name: Pool() for name in ("node", "furniture", "architecture")})
        self.next_category = mlp(2 * STATE, categories + 1)  # the last: none
        self.edge = nn.ModuleDict({name: mlp(4 * STATE, len(TYPES)) for name in ("furniture", "architecture")})

    @property
    def device(self) -> torch.device:
        """Where the weights are."""
        return next(self.parameters()).device

    def next_node(self, graphs: Sequence[Partial]) -> Tensor:
        """Return logits (B, categories + 1) of the next node's category; the last means that the graph is done."""
        state, of, _ = self._states("node", graphs)
        logits = self.next_category(self.pool["node"](state, of, len(graphs)))
        forbidden = torch.arange(self.categories + 1, device=logits.device) < len(ARCHITECTURE)
        return logits.masked_fill(forbidden, -torch.inf)

    def next_edge(self, graphs: Sequence[Partial], come_from: str) -> list[Tensor]:
        """Return for each graph the logits of edges to its last node, the new one.

        They come from its "furniture" or its "architecture": (anchors * 13 + 1,), in the order of the nodes; the last
        means no further edge.
        """
        state, of, counts = self._states(come_from, graphs)
        whole = self.pool[come_from](state, of, len(graphs))
        chosen = []
        for graph, states, pooled in zip(graphs, state.split(counts), whole, strict=True):
            anchors = states[_anchors(graph, come_from)]
            new, summed = (of.expand(len(anchors), -1) for of in (states[-1:], pooled))
            chosen.append(torch.cat([anchors, new, summed], 1))
        logits = self.edge[come_from](torch.cat(chosen)).split([len(c) for c in chosen])
        stop = torch.tensor([NO_EDGE], device=state.device)
        return [torch.cat([found.flatten(), stop]) for found in logits]

    def _states(self, decision: str, graphs: Sequence[Partial]) -> tuple[Tensor, Tensor, list[int]]:
        """Return the node states of all graphs, the graph of each node, and how many nodes each graph has."""
        device = self.device
        counts = [len(graph.category) for graph in graphs]
        first = np.cumsum([0, *counts[:-1]])
        category = torch.tensor([c for graph in graphs for c in graph.category], device=device)
        length = torch.tensor([x for graph in graphs for x in graph.length], device=device)
        features = torch.cat([nn.functional.one_hot(category, self.categories).float(), length[:, None]], 1)
        rows = [
            (a + f, b + f, t, turn) for graph, f in zip(graphs, first, strict=True) for a, b, t, turn in graph.edges
        ]
        table = torch.tensor(rows, dtype=torch.float32, device=device).reshape(-1, 4)
        types = nn.functional.one_hot(table[:, 2].long(), len(TYPES)).float()
        state = self.messages[decision](features, table[:, :2].long(), torch.cat([types, table[:, 3:]], 1))
        of = torch.repeat_interleave(torch.arange(len(graphs), device=device), torch.tensor(counts, device=device))
        return state, of, counts


def _anchors(graph: Partial, come_from: str) -> list[int]:
    """The nodes that edges to the last one may come from."""
    fixed = [k for k, category in enumerate(graph.category) if category < len(ARCHITECTURE)]
    return fixed if come_from == "architecture" else list(range(len(fixed), len(graph.category) - 1))


@dataclass(frozen=True)
class Decision:
    """A graph so far, and what comes next, as an index of the logits: a node's category or an edge."""

    graph: Partial
    right: int


def decisions(
    scene: Scene, graph: Graph, done: int, categories: Sequence[str], rng: np.random.Generator
) -> tuple[Decision, dict[str, Decision]]:
    """Return the decision on the node after `done` items of a room's graph and, if there is one, on edges to it.

    Edges come from "furniture", but for the first item, and from "architecture". Which of them are there already, is
    drawn.
    """
    items = list(graph)
    number = {k: k for k in range(scene.fixed)} | {item: scene.fixed + n for n, item in enumerate(items)}
    named = [categories.index(scene.category[item]) for item in items]

    def renumbered(edges: Sequence[Relation]) -> list[Relation]:
        return [Relation(number[r.anchor], number[r.target], r.type) for r in edges]

    so_far = with_items(
        architecture(scene, categories), named[:done], renumbered([r for item in items[:done] for r in graph[item]])
    )
    if done == len(items):
        return Decision(so_far, len(categories)), {}
    edges = {"furniture": [r for r in graph[items[done]] if r.anchor >= scene.fixed]}
    edges["architecture"] = [r for r in graph[items[done]] if r.anchor < scene.fixed]
    found = {}
    there: list[Relation] = []
    for come_from, own in edges.items():
        if come_from == "furniture" and not done:
            continue
        shuffled = renumbered([own[k] for k in rng.permutation(len(own))])[:MOST_EDGES]
        made = int(rng.integers(len(shuffled) + 1))
        partial = with_items(so_far, [named[done]], [*there, *shuffled[:made]])
        anchors = _anchors(partial, come_from)
        following = shuffled[made] if made < len(shuffled) else None
        right = len(anchors) * len(TYPES)
        if following is not None:
            right = anchors.index(following.anchor) * len(TYPES) + following.type
        found[come_from] = Decision(partial, right)
        there += shuffled
    return Decision(so_far, named[done]), found


def loss(network: GraphNetwork, nodes: Sequence[Decision], edges: dict[str, list[Decision]]) -> Tensor:
    """Return the cross entropy of decisions: the mean of each kind, summed."""
    device = network.device
    total = torch.zeros((), device=device)
    if nodes:
        logits = network.next_node([d.graph for d in nodes])
        total = total + nn.functional.cross_entropy(logits, torch.tensor([d.right for d in nodes], device=device))
    for come_from, known in edges.items():
        if not known:
            continue
        rows = network.next_edge([d.graph for d in known], come_from)
        padded = pad_sequence(rows, batch_first=True, padding_value=-1e9)
        total = total + nn.functional.cross_entropy(padded, torch.tensor([d.right for d in known], device=device))
    return total


@torch.no_grad()
def sample(
    network: GraphNetwork,
    scene: Scene,
    categories: Sequence[str],
    kept: KeptTypes,
    most: int,
    rng: np.random.Generator,
    given: Sequence[str] | None = None,
    known: Sequence[Sequence[Relation]] = (),
) -> tuple[list[str], Graph]:
    """Draw furniture and its graph for a room: categories, and the edges to each, numbered from scene.fixed on.

    With `given` categories, in this order, only the edges are drawn; the first items' may be `known`. Else there are at
    most `most` items. Edges that are not `kept` are not drawn; where none leads to an item, they are drawn again,
    REDRAWS times in all.
    """
    partial = architecture(scene, categories)
    names: list[str] = []
    graph: Graph = {}
    while len(names) < (most if given is None else len(given)):
        if given is None:
            chosen = _choice(network.next_node([partial])[0].softmax(0), rng)
            if chosen == len(categories):
                break
            name = categories[chosen]
        else:
            name = given[len(names)]
        partial = with_items(partial, [categories.index(name)], [])
        if len(names) < len(known):
            edges = list(known[len(names)])
        else:
            draws = (_edges(network, partial, categories, kept, rng) for _ in range(REDRAWS))
            edges = next((drawn for drawn in draws if drawn), [])
        graph[scene.fixed + len(names)] = edges
        partial = with_items(partial, [], edges)
        names.append(name)
    return names, graph


def _edges(
    network: GraphNetwork, graph: Partial, categories: Sequence[str], kept: KeptTypes, rng: np.random.Generator
) -> list[Relation]:
    """Draw edges to the graph's last node one after the other, at most one from each anchor."""
    new = len(graph.category) - 1
    name = categories[graph.category[new]]
    made: list[Relation] = []
    for come_from in ("furniture", "architecture"):
        anchors = _anchors(graph, come_from)
        known = np.array(
            [[(categories[graph.category[a]], name, t) in kept for t in range(len(TYPES))] for a in anchors]
        ).reshape(-1, len(TYPES))
        for _ in range(MOST_EDGES if len(anchors) else 0):
            chance = network.next_edge([graph], come_from)[0].softmax(0)
            allowed = torch.tensor(known.flatten(), device=chance.device) & (chance[:-1] >= UNLIKELY)
            chance[:-1] = chance[:-1].where(allowed, 0.0)
            chosen = _choice(chance, rng)
            if chosen == known.size:
                break
            anchor, type = divmod(chosen, len(TYPES))
            known[anchor] = False
            made.append(Relation(anchors[anchor], new, type))
            graph = with_items(graph, [], made[-1:])
    return made


def _choice(chance: Tensor, rng: np.random.Generator) -> int:
    weights = chance.double().cpu().numpy()
    return int(rng.choice(len(weights), p=weights / weights.sum()))
