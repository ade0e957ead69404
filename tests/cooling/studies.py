"""Studies that the tests ask, as text."""

from __future__ import annotations

from pathlib import Path

from lptn.planners.trade import TradeStudy, parse_study


def study(
    goal: str,
    task: str,
    limits: str = "",
    motors: str = '[[motors]]\nname = "U8"',
    more: str = "",
    cooling: str = "",
    currency: str = "",
) -> TradeStudy:
    """A study at 21.5 degC."""
    chosen = f"cooling = [{cooling}]\n" * bool(cooling) + f'currency = "{currency}"\n' * bool(currency)
    head = f'[study]\nname = "test"\ngoal = "{goal}"\n{chosen}\n'
    return parse_study(
        f"{head}[task]\nambient = 21.5\n{task}\n[limits]\n{limits}\n{motors}\n{more}\n", Path("study.toml")
    )


HELD = "mass = 0.55\nvolume = 450e-6"
