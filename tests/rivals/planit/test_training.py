"""PlanIT learns: every network overfits three rooms, from the examples that it is said to; it goes on exactly."""

from __future__ import annotations

import io

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn.functional import one_hot

from layoutrl.rivals.budgets import seconds_budget, updates_budget
from layoutrl.rivals.planit import generator
from layoutrl.rivals.planit.canvas import FURNITURE
from layoutrl.rivals.planit.generator import Decision
from layoutrl.rivals.planit.graph import MIRRORED, scene_of
from layoutrl.rivals.planit.model import PlanIT, counted
from layoutrl.rivals.planit.networks import SIDE, signed_distance
from layoutrl.rivals.planit.placement import Choosing, Placer
from layoutrl.rivals.planit.scoring import given_query
from layoutrl.rivals.planit.training import DECISIONS, LOSSES, Training
from tests.rivals.planit.rooms import designed

ROOMS = designed("bathroom", 3)
SCENES = [scene_of(room) for room in ROOMS]


def training(updates: int, batch: int = 4, report_every: int = 10, seed: int = 0) -> Training:
    network_seed, training_seed = np.random.SeedSequence(seed).spawn(2)
    return Training(
        PlanIT(counted(ROOMS, SCENES), network_seed),
        ROOMS,
        SCENES,
        updates_budget(updates),
        batch=batch,
        learning_rate=3e-3,
        report_every=report_every,
        seed=training_seed,
    )


@pytest.fixture(scope="module")
def overfitted() -> tuple[PlanIT, list[dict[str, float]]]:
    run = training(130, batch=6, report_every=26)
    reports = [report.loss for report in run]
    return run.model, reports


def test_every_network_overfits_three_rooms(overfitted: tuple[PlanIT, list[dict[str, float]]]) -> None:
    _, reports = overfitted
    first, last = reports[0], reports[-1]
    assert set(last) == set(LOSSES)
    assert last["location"] < 0.15 * first["location"]
    assert last["orientation"] < 0.1 * first["orientation"]
    assert last["size"] < 0.35 * first["size"]
    assert last["graph"] < 0.6 * first["graph"]  # the order of edges stays a matter of chance


def test_the_item_goes_where_it_was_and_as_it_was(overfitted: tuple[PlanIT, list[dict[str, float]]]) -> None:
    model, _ = overfitted
    placer = Placer(model, ROOMS, SCENES)
    queries = [given_query(placer, room) for room in range(len(ROOMS))]
    facings, away, errors = 0, [], []
    for query, heat in zip(queries, placer.heat(queries), strict=True):
        moving = ROOMS[query.room].moving
        item = placer.target(query, heat, Choosing())
        assert item is not None
        away.append(np.linalg.norm(np.subtract(item.center, moving.center)))
        facings += item.rotation == moving.rotation
        errors.append(np.abs(np.subtract(item.size, moving.size)).max())
    assert np.median(away) < 3 * placer.pixel  # 0.3 m
    assert facings == 3
    assert np.median(errors) < 0.06  # it draws sizes from a distribution


@pytest.mark.usefixtures("small_networks")
def test_each_network_is_asked_about_the_item_that_is_to_be_placed(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it overfits could be told by less: three rooms are known by their walls."""
    run, drawn = training(1, batch=64), []
    example = run._example
    monkeypatch.setattr(run, "_example", lambda: drawn.append(example()) or drawn[-1])
    asked: dict[str, tuple[Tensor, Tensor]] = {}
    model = run.model
    networks = {"location": model.location, "orientation": model.orientation, "discriminator": run._discriminator}
    networks |= {"prior": model.size.prior, "encoder": model.size.encoder}
    for name, network in networks.items():
        network.register_forward_hook(lambda _, inputs, __, name=name: asked.update({name: inputs}))
    run._update()
    assert len(drawn) == 64
    items = [ROOMS[e.room].furniture[e.item - e.scene.fixed] for e in drawn]
    categories = torch.tensor([model.statistics.categories.index(item.category) for item in items])
    for name in ("orientation", "prior", "encoder", "discriminator"):
        assert torch.equal(asked[name][1], one_hot(categories, len(model.statistics.categories)).float()), name
    size = torch.tensor([item.size for item in items]) / (model.statistics.span / 2)
    torch.testing.assert_close(asked["encoder"][0][:, -1:], signed_distance(size))
    assert torch.equal(asked["encoder"][0][:, :-1], asked["prior"][0])
    types = np.array([e.edge.type for e in drawn])
    seen = asked["location"][1].numpy()
    assert ((seen == types) | (seen == MIRRORED[types])).all()
    one_sided = types != MIRRORED[types]
    assert {*(seen == types)[one_sided]} == {True, False}  # about half of the pictures are mirrored
    pixels = asked["orientation"][0][:, FURNITURE].sum((1, 2)).numpy()  # of furniture, in a view that may cut some
    pixel = (model.statistics.span / SIDE) ** 2
    area = [sum(np.prod(ROOMS[e.room].furniture[k - e.scene.fixed].size) for k in e.placed) for e in drawn]
    assert (pixels * pixel <= np.array(area) + 1e-3).all()  # the item itself is not shown
    assert (pixels * pixel > 0.5 * np.array(area)).any()


@pytest.mark.usefixtures("small_networks")
def test_the_discriminator_learns_to_tell_true_sizes_from_new_ones() -> None:
    """Of a size network that learns nothing meanwhile."""
    run, said = training(20, batch=8), []
    run.model.size.requires_grad_(False)
    run._discriminator.register_forward_hook(lambda _, __, output: said.append(output.detach()))
    list(run)
    true, new = said[-2:]
    assert (true > 0).float().mean() > 0.8
    assert (new < 0).float().mean() > 0.8


@pytest.mark.usefixtures("small_networks")
def test_the_same_seed_learns_the_same_and_another_something_else() -> None:
    one, same, other = (list(training(4, report_every=2, seed=seed)) for seed in (0, 0, 1))
    assert one == same
    assert one != other


@pytest.mark.usefixtures("small_networks")
def test_a_training_that_goes_on_is_the_one_that_never_stopped() -> None:
    """Bit for bit, through a file that is loaded without running code."""
    whole = training(6, report_every=4)
    reports = list(whole)
    begun = training(6, report_every=4)

    def spent(updates: int) -> float:
        begun.stopping = updates == 2
        return updates / 6

    begun._spent = spent
    assert list(begun) == []
    assert begun.updates == 2
    file = io.BytesIO()
    torch.save(begun.state_dict(), file)
    file.seek(0)
    on = training(6, report_every=4, seed=9)
    on.load_state_dict(torch.load(file, weights_only=True))
    assert list(on) == reports
    for name, value in whole.model.state_dict().items():
        assert torch.equal(value, on.model.state_dict()[name]), name


def test_a_training_by_time_goes_on_with_what_is_left_and_its_consumer_takes_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now, shares = [50.0], []

    def begun() -> Training:
        run = training(1, report_every=2)
        run._spent = seconds_budget(8, lambda: now[0])
        return run

    def update(run: Training) -> None:
        shares.append(run.share)
        run.updates += 1
        now[0] += 1

    monkeypatch.setattr(Training, "_update", update)
    monkeypatch.setattr(Training, "_report", lambda run: run.updates)
    first, reports, state = begun(), [], {}
    for report in first:
        reports.append(report)
        now[0] += 100  # an evaluation
        state = first.state_dict()
        if report == 4:
            break  # a kill
    now[0] += 1000
    second = begun()
    second.load_state_dict(state)
    assert [*reports, *second] == [2, 4, 6, 8]
    assert shares == [k / 8 for k in range(8)]
    assert second.share == 1


def test_of_an_item_that_comes_last_only_its_edges_are_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    run = training(1)
    examples = [run._example() for _ in range(60)]
    last = [e for e in examples if e.last]
    found: list[tuple[list[Decision], dict[str, list[Decision]]]] = []
    monkeypatch.setattr(generator, "loss", lambda _, nodes, edges: found.append((nodes, edges)))
    run._graph_loss(last)
    run._graph_loss([e for e in examples if not e.last])
    (no_nodes, edges), (nodes, _) = found
    assert no_nodes == []
    assert len(nodes) == DECISIONS * (60 - len(last))
    asked = iter(edges["architecture"])
    for e in last:
        assert e.item == list(e.graph)[-1]
        for _ in range(DECISIONS):
            graph = next(asked).graph
            assert len(graph.category) == e.scene.fixed + len(e.graph)
            assert graph.category[-1] == run.model.statistics.nodes.index(e.scene.category[e.item])


def test_half_of_the_examples_place_an_item_after_all_others() -> None:
    run = training(1)
    examples = [run._example() for _ in range(400)]
    for e in examples:
        assert e.item not in e.placed
        assert e.edge in e.graph[e.item]
        assert all(r.anchor < e.scene.fixed or r.anchor in e.placed for r in e.graph[e.item])
    last = np.mean([len(e.placed) == len(e.scene.items) - 1 for e in examples])
    assert 0.5 < last < 0.85  # of the others one in so many comes last, too
