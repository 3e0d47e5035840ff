"""Table 1 of Di & Yu 2021, and what it leaves out: eight room types, rooms never seen, one random start each.

    python experiments/table1.py [budget=smoke] [column=paper room=bedroom,tatami] [hydra.launcher.n_jobs=2]

Fills the cells that are not filled, side by side, and prints the tables that all filled ones make.
"""

from __future__ import annotations

import sys

import torch
from cells import cells_of, given, multirun
from printing import NOT_RUN, Row, Table, minutes, row, write

# Of the paper: PlanIT's and its own IoU, as printed there.
PAPER = {
    "bathroom": ("0.623 ± 0.008", "0.961 ± 0.014"),
    "bedroom": ("0.647 ± 0.009", "0.952 ± 0.026"),
    "study": ("0.619 ± 0.006", "0.957 ± 0.018"),
    "tatami": ("0.637 ± 0.006", "0.948 ± 0.049"),
    "living_room": ("0.603 ± 0.006", "0.953 ± 0.037"),
    "dining_room": ("0.611 ± 0.006", "0.949 ± 0.029"),
    "kitchen": ("0.636 ± 0.006", "0.953 ± 0.041"),
    "balcony": ("0.651 ± 0.006", "0.951 ± 0.035"),
}
# What is beside it: the file's column, its row, the words in the table.
COLUMNS = (
    ("geometric", "agent", "geometric"),
    ("paper", "agent", "paper's network and moves"),
    ("regressor", "agent", "supervised regressor"),
    ("oracle", "oracle", "perfect Q"),
    ("rules", "nearest room", "nearest room"),
    ("rules", "nearest wall", "nearest wall"),
    ("rules", "random start", "random start"),
)
HEADER = ("", "PlanIT (paper)", "ours (paper)", *(words for _, _, words in COLUMNS), "lattice ceiling")
AGENTS = ("geometric", "paper", "regressor")
ALL = ",".join(PAPER)
WITHOUT_GPU = "bedroom,tatami"  # rooms in which the paper's network is trained on a processor


def main(arguments: list[str]) -> int:
    chosen, folder, status = given(arguments), cells_of("table1", arguments), 0
    everywhere = torch.cuda.is_available() or chosen.get("budget") == "smoke"
    # One after the other: the regressor trains for as long as the agent did.
    stages = {"geometric,rules,oracle": ALL, "regressor": ALL, "paper": ALL if everywhere else WITHOUT_GPU}
    for columns, rooms in {chosen["column"]: ALL}.items() if "column" in chosen else stages.items():
        seeds = "0" if rooms == WITHOUT_GPU else "0,1,2"
        # The first varies slowest.
        status = multirun("table1", {"column": columns, "seed": seeds, "room": rooms}, arguments) or status

    def found(room: str, column: str, which: str = "agent") -> Row | None:
        return row(folder, f"{room}-own-{column}", which)

    lines, errors, every = [], [], []
    for room, (planit, own) in PAPER.items():
        rows = [found(room, column, which) for column, which, _ in COLUMNS]
        ceiling = next((f"{r.cells[0]['ceiling']:.3f}" for r in rows if r), NOT_RUN)
        lines.append([room.replace("_", " "), planit, own, *(r.text() if r else NOT_RUN for r in rows), ceiling])
        every += [found(room, column) for column in AGENTS] + [found(room, "oracle", "oracle")]
        regressor = found(room, "regressor")
        for column in AGENTS:
            agent = found(room, column)
            if agent:
                beside = None if column == "regressor" else regressor
                errors.append([room.replace("_", " "), column, *details(agent, beside)])
    about = f"{minutes(every)}; mean IoU ± standard deviation over rooms, of all seeds"
    tables = [
        Table(f"Table 1, rooms never seen ({about})", HEADER, lines),
        Table("Table 1, how sure and how good", ["", *DETAILS], errors),
    ]
    write(tables, folder.with_name("table1"))
    return status


DETAILS = (
    "", "seeds", "mean IoU", "s.e. over seeds", "95% interval over rooms", "median", ">= 0.9", "overlap", "outside",
    "blocked", "moves", "minutes of training", "p, against the regressor",
)  # fmt: skip


def details(agent: Row, regressor: Row | None) -> list[str]:
    """What the mean does not say."""
    moves = [cell["moves"] for cell in agent.cells if "moves" in cell]
    return [
        str(len(agent.cells)),
        f"{agent.mean:.4f}",
        agent.error_over_seeds(),
        agent.interval(),
        f"{agent.number('median_iou'):.3f}",
        f"{agent.number('share_090'):.1%}",
        f"{agent.number('overlap'):.4f}",
        f"{agent.number('outside'):.4f}",
        f"{agent.number('blocked'):.1%}",
        f"{sum(moves) / len(moves):.1f}" if moves else "-",
        f"{sum(cell['training_seconds'] for cell in agent.cells) / len(agent.cells) / 60:.1f}",
        agent.p_value(regressor) if regressor else "-",
    ]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
