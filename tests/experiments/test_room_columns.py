"""Columns of whole rooms learn from the rooms that they say."""

from __future__ import annotations

import pytest
from cell_config import designer
from room_columns import whole_rooms_of

from layoutrl.rooms.sources.parts import Data, whole_parts
from layoutrl.runs.config import TrainConfig, narrowed
from tests.experiments.builders import REAL, configured


@pytest.mark.skipif(not REAL.is_dir(), reason=f"the real rooms are not in {REAL}")
def test_whole_real_rooms_are_furnished_by_what_learned_in_them_in_designed_ones_or_in_both(tmp_path):
    real = ("room=tatami", "data=designer_rooms", f"data.root={REAL / 'designer_rooms'}")
    settings = {
        name: whole_rooms_of(configured(tmp_path, "column=rooms_agent", *real, f"trained_on={name}"), "cpu")
        for name in ("own", "designer", "both")
    }
    own, designed, both = (settings[name].training for name in ("own", "designer", "both"))
    assert both == designed + own
    undisturbed, disturbed = (
        whole_parts("tatami", Data("designer", train_rooms=12, test_rooms=6, seed=0, disturbed=share), 0)[0]
        for share in (0.0, 0.5)
    )
    assert designed == disturbed != undisturbed
    assert {room.group for room in own}.isdisjoint(room.group for room in settings["own"].designs)
    for setting in settings.values():
        assert setting.designs == settings["own"].designs


def test_a_cell_says_how_many_of_the_designed_rooms_were_disturbed_and_that_no_real_one_was(tmp_path):
    for trained_on, share in (("own", 0.0), ("both", 0.5)):
        config = configured(tmp_path, "column=rooms_agent", "data=designer_rooms", f"trained_on={trained_on}")
        assert narrowed(config, TrainConfig).data.disturbed == 0
        assert config.data.disturbed == designer(config).disturbed == share
