"""Which of the thesis's facts go together: χ² of networks against them: `python examples/u8_thesis/contradictions.py`.

Takes half a minute. What no network meets is named by its misfit in standard deviations.
"""

from __future__ import annotations

from facts import FAMILIES, LITERAL, PROJECTED, RECOMMENDED, STATOR, Fitted, fit, misfits

_NAMED = 2.0  # standard deviations


def describe(title: str, found: Fitted) -> str:
    """One fit in three lines."""
    worst = [f"{name} {value:+.1f} σ" for name, value in found.misfits.items() if abs(value) > _NAMED]
    values = ", ".join(f"{n} {v:.3g}" for n, v in zip(found.family.parameters, found.values, strict=True))
    off = "; ".join(worst) or "none beyond 2 σ"
    return f"{found.family.name}; {title}: χ² {found.chi_squared:.1f}\n    {values}\n    off: {off}"


def main() -> None:
    """Fit every family to both readings of the facts."""
    for family in FAMILIES:
        for title, facts in (("steady states taken literally", LITERAL), ("as projected, and +20 s", PROJECTED)):
            print(describe(title, fit(family, facts)))
    ready = Fitted(STATOR, RECOMMENDED, misfits(STATOR, RECOMMENDED, LITERAL))
    print(describe("values of the ready models, not refitted, literal", ready))


if __name__ == "__main__":
    main()
