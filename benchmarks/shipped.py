"""Check that the current commands reproduce the shipped policies: `python benchmarks/shipped.py`.

Reads the commands from the cards in trained/README.md, runs each, and compares every number of the
policy with that of the shipped files. With --scores it prints the tables of the cards instead. Bit
for bit holds on the machine and with the versions that the cards name; elsewhere the last digits
of a training may differ.
"""

from __future__ import annotations

import argparse
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np

import qcompile
from qcompile.arrays import IntArray
from qcompile.cli.group import cli
from qcompile.policy import Policy

TRAINED = Path(__file__).parents[1] / "trained"
SHOWN = ("lunarlander", "acrobot", "cartpole", "cartpole_1q")
HELD = ("lunarlander_hold", "acrobot_hold", "cartpole_hold")
EPISODES, FIRST_SEED = 100, 10_000
_COMMAND = re.compile(r"^qcompile (train .*)$", re.MULTILINE)

COLUMNS: dict[str, dict[str, Any]] = {
    "exact": {"shots": "exact"},
    "exact, greedy": {"shots": "exact", "greedy": True},
    "ibm_lima, 1024": {"backend": "ibm_lima", "shots": 1024},
    "ibm_lima, 8192": {"backend": "ibm_lima", "shots": 8192},
    "ibm_lima, 8192, no mitigation": {"backend": "ibm_lima", "shots": 8192, "mitigation": "none"},
}
HARDWARE, DECIDED_AT = "fake_fez", 64
HELD_COLUMNS: dict[str, dict[str, Any]] = {
    "exact": {"shots": "exact"},
    **{f"{HARDWARE}, {shots}": {"backend": HARDWARE, "shots": shots} for shots in (32, 64, 128)},
}


def commands() -> Iterator[tuple[str, list[str]]]:
    """The name of each shipped policy and the arguments that train it, as the cards have them."""
    for line in _COMMAND.findall((TRAINED / "README.md").read_text()):
        arguments = shlex.split(line)
        yield Path(arguments[arguments.index("--out") + 1]).stem, arguments


def differing(left: Policy, right: Policy) -> list[str]:
    """The parts of two policies that differ in any bit."""
    arrays = {
        name: (getattr(left, name), getattr(right, name)) for name in ("theta", "weights", "bias")
    }
    for name in ("feature", "scale", "gains"):
        arrays[name] = getattr(left.encoder, name), getattr(right.encoder, name)
    names = [name for name, pair in arrays.items() if not np.array_equal(*pair)]
    plain = ("environment", "program", "environment_kwargs", "hold")
    names += [name for name in plain if getattr(left, name) != getattr(right, name)]
    if left.encoder.functions != right.encoder.functions:
        names.append("functions")
    return names


def remake(names: set[str]) -> bool:
    """Train the policies `names`, or all, and report whether each equals the shipped one."""
    same = True
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in commands():
            if names and name not in names:
                continue
            out = Path(folder) / f"{name}.pt"
            arguments[arguments.index("--out") + 1] = str(out)
            cli.main(arguments, standalone_mode=False)
            policy = qcompile.load_policy(out)
            for shipped in (TRAINED / f"{name}.pt", TRAINED / f"{name}.json"):
                parts = differing(policy, qcompile.load_policy(shipped))
                same = same and not parts
                words = f"differs in {', '.join(parts)}" if parts else "the same"
                click.echo(f"{shipped.name}: {words}")
    return same


def scores() -> None:
    """The tables of the cards: mean ± standard deviation over the same episodes.

    The table of held decisions also has their mean and largest number in an episode.
    """
    print_row("policy", "circuits", "trained numbers", *COLUMNS)
    click.echo("|" + "---|" * (3 + len(COLUMNS)))
    for name in SHOWN:
        policy = qcompile.load_policy(TRAINED / f"{name}.pt")
        played = [score for score, _ in played_in(policy, COLUMNS)]
        print_row(name, len(policy.program), policy.parameter_count, *played)
    click.echo()
    decided = f"decisions, {HARDWARE}, {DECIDED_AT}"
    print_row("policy", "hold", "circuits", "trained numbers", *HELD_COLUMNS, decided)
    click.echo("|" + "---|" * (5 + len(HELD_COLUMNS)))
    for name in HELD:
        policy = qcompile.load_policy(TRAINED / f"{name}.pt")
        results = dict(zip(HELD_COLUMNS, played_in(policy, HELD_COLUMNS), strict=True))
        _, lengths = results[f"{HARDWARE}, {DECIDED_AT}"]
        decisions = -(-lengths // policy.hold)
        cells = [name, policy.hold, len(policy.program), policy.parameter_count]
        cells += [score for score, _ in results.values()]
        print_row(*cells, f"{decisions.mean():.0f}, at most {decisions.max()}")


def played_in(policy: Policy, columns: dict[str, dict[str, Any]]) -> Iterator[tuple[str, IntArray]]:
    """The policy's score in each column, and the lengths of its episodes in steps."""
    for arguments in columns.values():
        result = qcompile.run(
            policy, episodes=EPISODES, seed=FIRST_SEED, progress=False, **arguments
        )
        lengths = np.array([episode["length"] for episode in result.to_dict()["episodes"]])
        yield f"{np.mean(result.rewards):.1f} ± {np.std(result.rewards):.1f}", lengths


def print_row(*cells: object) -> None:
    click.echo(f"| {' | '.join(map(str, cells))} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scores", action="store_true", help="print the tables of the cards")
    parser.add_argument("names", nargs="*", metavar="NAME", help="only these policies")
    chosen = parser.parse_args()
    if chosen.scores:
        scores()
    elif not remake(set(chosen.names)):
        sys.exit(1)


if __name__ == "__main__":
    main()
